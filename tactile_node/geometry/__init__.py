"""Outlines, distances from them and coverage of taxels: plane geometry, in taxel pitches."""
