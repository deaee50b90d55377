"""Turn a taxel frame into a contact pattern, which groups the pressed taxels by contact."""
