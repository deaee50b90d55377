"""The ``tactile`` command: one module a sub-command."""
