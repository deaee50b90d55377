"""Demo in which scripted touches of a simulated gripper skin show the results from taxel to shape: `make demo`."""
