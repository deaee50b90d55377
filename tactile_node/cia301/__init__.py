"""Facts of CiA 301 (CANopen), each defined once, and state machines over its frames. Pure: no bus, no thread.

``node_id``         range of node-IDs
``connection_set``  COB-IDs of the services, and the ones that are reserved
``cob_id``          COB-IDs as EDS and layout files write them, and their flags
``objects``         indices of the communication objects
``nmt``             NMT commands and states
``heartbeat``       what was last received of each node
``emergency``       EMCY messages, decoded
``pdo``             sizes, transmission types, multiplexed PDOs
``sdo``             SDO commands and abort codes
``sdo_upload``      follows SDO uploads by their frames
``cia404``          facts of CiA 404 (measuring devices)
"""
