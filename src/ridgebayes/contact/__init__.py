"""Contact mechanics: arrays and numbers in, arrays and a status out; no scenes, no tables."""
