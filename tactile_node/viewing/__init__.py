"""Live page, terminal view and report of a bus, a recording or a bag, with the data that they show."""
