"""From taxel frame to taxel frame: corrections of the values before contacts are found."""
