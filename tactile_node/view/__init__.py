"""What a person sees of the skin: newest state of each pad -> page in the browser, or picture on a terminal."""
