# `tactile bringup` with the arguments of the container, as its only process, so that SIGTERM reaches it.
source /opt/tactile_ws/install/setup.bash
exec tactile bringup "$@"
