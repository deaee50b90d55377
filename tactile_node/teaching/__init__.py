"""Labelled touches -> heads of taught shapes, with what they get right on touches held out. Curves of `volf`."""
