"""Results on disk: one folder per run, written atomically, checked when read."""
