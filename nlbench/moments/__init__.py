"""Moments of a state, how they close, how they change in time, and their integration."""
