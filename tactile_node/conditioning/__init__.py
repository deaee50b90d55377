"""Taxel frame -> taxel frame: corrections of the values before a contact is looked for."""
