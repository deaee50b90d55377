"""What a recording holds, as facts and as one page for a support ticket."""
