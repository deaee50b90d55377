"""Define each fact of CiA 301 (CANopen) once. The state machines for its frames use neither a bus nor threads."""
