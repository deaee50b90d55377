"""Facts of CiA 301 (CANopen), each defined once, and state machines for its frames, without a bus or threads."""
