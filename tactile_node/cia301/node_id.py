"""The range of node-IDs (CiA 301, 7.2.1)."""

MIN_NODE_ID = 1
MAX_NODE_ID = 127
ALL_NODES = 0  #: in an NMT command
