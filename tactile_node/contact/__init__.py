"""From a taxel frame to a contact pattern: which taxels are pressed, and which of them belong together."""
