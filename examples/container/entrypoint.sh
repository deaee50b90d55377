# Run `tactile bringup` with the container's arguments as its only process, so that SIGTERM reaches it.
source /opt/tactile_ws/install/setup.bash
exec tactile bringup "$@"
