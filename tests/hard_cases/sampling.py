"""Hard cases of sampling: walks that look done and are not."""
