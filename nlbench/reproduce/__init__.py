"""The figures and tables of the sources: which experiments answer for each, and the verdict on it, by fixed rules."""
