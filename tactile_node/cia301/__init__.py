"""Facts of CiA 301 (CANopen), each defined once, and state machines for its frames, without bus and threads."""
