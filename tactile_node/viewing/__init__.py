"""What the bus, a recording or a bag holds, as facts; the page and the terminal that show it, and the report."""
