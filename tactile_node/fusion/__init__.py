"""Recognitions of successive frames as one."""
