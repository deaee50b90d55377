"""Define each fact of CiA 301 (CANopen) once. The state machines for CANopen frames use neither a bus nor threads."""
