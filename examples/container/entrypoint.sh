# Run `tactile bringup` as the only process of the container, so that SIGTERM reaches this process.
source /opt/tactile_ws/install/setup.bash
exec tactile bringup "$@"
