"""Turn a taxel frame into a contact pattern, which says which taxels are pressed and which of them belong together."""
