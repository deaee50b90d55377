"""Facts of CiA 301 (CANopen), each defined once, and state machines over its frames. Pure: no bus, no thread."""
