"""Time loads of round ridges: ``OMP_NUM_THREADS=1 python benchmarks/round_corners.py [N]``.

Random textures with a/R from 0.005 to 0.05, a/b from 0.2 to 5, corners of a/50 to a/5, to p/E =
0.3, found together and the first N also one by one (some minutes with 10), in CPU seconds.
"""

import sys
import time
from collections.abc import Iterator
from dataclasses import replace
from unittest import mock

import numpy as np

from ridgebayes.contact import reaching
from ridgebayes.contact.all_events import Events
from ridgebayes.contact.contact_solution import load_factor
from ridgebayes.contact.reaching import TransitionLoads, reaching_loads
from ridgebayes.contact.rigid_profile import Profile
from ridgebayes.contact.two_scale import half_plane_load

N, SEED = 100, 22
W_MAX = load_factor(0.5) * float(half_plane_load(0.3))
NONE = Events(np.empty(0), "one by one")


def profiles(where: str) -> Iterator[Profile]:
    """Yield the same textures for each place of the body."""
    rng = np.random.default_rng(SEED)
    for _ in range(N):
        a = 0.005 * 10 ** rng.uniform()
        b = a / (0.2 * 25 ** rng.uniform())
        corner = a / (5 * 10 ** rng.uniform())
        offset = rng.uniform(-0.5, 0.5)
        yield Profile(a, b, corner=corner, offset=offset if where == "off centre" else 0.0)


def timed(profile: Profile) -> tuple[float, TransitionLoads]:
    """Return CPU seconds of all loads of a texture, and these."""
    start = time.process_time()
    found = reaching_loads(profile, W_max=W_MAX)
    return time.process_time() - start, found


def main() -> None:
    n_single = int(sys.argv[1]) if len(sys.argv) > 1 else 0
    timed(Profile(0.05, 0.05, corner=0.005))  # warm
    for where in ("centred", "off centre"):
        seconds, ratios, apart, ok = [], [], [], True
        for i, profile in enumerate(profiles(where)):
            spent, found = timed(profile)
            seconds.append(spent)
            ok &= set(found.status) <= {"ok"}
            if i < n_single:
                with mock.patch.object(reaching, "all_events", return_value=NONE):
                    # A floor that is never touched: without one there is no other way.
                    slow, single = timed(replace(profile, depth=1.0))
                ratios.append(slow / spent)
                apart.append(float(np.abs(found.W / single.W - 1).max(initial=0.0)))
        print(
            f"{where}: {N} textures, median {np.median(seconds):.3f} s, 90 % within "
            f"{np.quantile(seconds, 0.9):.2f} s, longest {max(seconds):.2f} s, all ok: {ok}"
        )
        if ratios:
            print(
                f"  one by one: {np.median(ratios):.0f} times as long (to {max(ratios):.0f}); "
                f"loads differ by up to {max(apart):.1e}"
            )


if __name__ == "__main__":
    main()
