"""The ``tactile`` command, with one module per sub-command."""

