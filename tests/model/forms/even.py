"""A form whose posterior has two modes that are mirror images."""

import numpy as np

from ridgebayes import Modified


class Even(Modified):
    """Modified with the square of c2/0.05 for c: rows cannot tell c2 from -c2."""

    name = "even"

    @property
    def parameter_names(self):
        return ("c2",)

    def rate(self, theta, a_over_R, b_over_R):
        return (super().rate(theta, a_over_R, b_over_R) / 0.05) ** 2

    def log_rate_gradient(self, theta, a_over_R, b_over_R):
        with np.errstate(divide="ignore"):
            return 2 * super().log_rate_gradient(theta, a_over_R, b_over_R)
