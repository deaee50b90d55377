"""From presses of one known object to the response of a skin: the depth of its taxels and their curve."""
