"""Contact shape from a tactile skin: CAN frame -> taxel frame -> pattern -> features -> shape.

One folder a stage; ``docs/architecture.md`` says which folder may import which.
"""
