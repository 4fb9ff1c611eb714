"""ridgebayes: calibrated, uncertainty-aware counts of ridges in contact."""
