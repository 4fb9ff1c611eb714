import json
import math

import numpy as np
import pytest

from ridgebayes import (
    Empirical,
    Gamma,
    HalfNormal,
    InputError,
    LogNormal,
    Normal,
    Truncated,
    Uniform,
)
from ridgebayes.distributions.grammar import from_dict, parse_distribution, to_dict

KNOWN = {
    "normal(0, 0.05)": Normal(0.0, 0.05),
    " normal ( -2 , 10 % ) ": Normal(-2.0, 0.2),
    "lognormal(1.382, 10%)": LogNormal(1.382, 0.1),
    "halfnormal(5e-2)": HalfNormal(0.05),
    "gamma(2, 0.1)": Gamma(2.0, 0.1),
    "uniform(-1, 3)": Uniform(-1.0, 3.0),
    "truncated(normal(1, 10 %), 0, inf)": Truncated(Normal(1.0, 0.1), 0.0, math.inf),
    "truncated(uniform(0, 1), 0.2, 9)": Truncated(Uniform(0.0, 1.0), 0.2, 9.0),
}


@pytest.mark.parametrize("text", KNOWN)
def test_parse__is_the_distribution_and_comes_back_from_plain_values(text):
    own = parse_distribution(text, "c")
    assert own == KNOWN[text]
    assert from_dict(json.loads(json.dumps(to_dict(own)))) == own


def test_parse__empirical_is_of_a_column_beside_the_file(tmp_path):
    values = np.linspace(1.2, 1.5, 40)
    lines = ["c,d", *(f"{value!r},x" for value in values.tolist())]
    (tmp_path / "draws.csv").write_text("\n".join(lines), encoding="utf-8")
    own = parse_distribution("empirical(draws.csv, c)", "c1", folder=tmp_path)
    assert isinstance(own, Empirical)
    assert own.source == "c of draws.csv"
    assert float(own.value_at(0.0)) == pytest.approx(1.35, abs=0.005)  # discretisation: 40 values
    assert from_dict(json.loads(json.dumps(to_dict(own)))) == own
    cut = parse_distribution("truncated(empirical(draws.csv, c), 1.3, inf)", "c1", folder=tmp_path)
    assert cut.support == (1.3, math.inf)
    assert from_dict(json.loads(json.dumps(to_dict(cut)))) == cut


def test_parse__numbers_with_units_are_the_callers(tmp_path):
    def number(text):
        value, _, unit = text.partition(" ")
        return float(value) * {"kPa": 1e3, "Pa": 1.0}[unit] if unit else 1 / 0

    def parsed(text):
        return parse_distribution(text, "youngs_modulus", number=number, folder=tmp_path)

    assert parsed("lognormal(60 kPa, 20 %)") == LogNormal(60e3, 0.2)
    assert parsed("lognormal(60 kPa, 0.2)") == LogNormal(60e3, 0.2)
    assert parsed("normal(60 kPa, 500 Pa)") == Normal(60e3, 500.0)
    assert parsed("truncated(normal(60 kPa, 5 %), 50 kPa, inf)").low == 50e3


BAD = {
    "student(1, 2)": "expected one of normal(mean, sd), lognormal(median, log_sd)",
    "": "expected one of",
    "normal": "expected one of",
    "normal(1, 2": "expected one of",
    "normal(1, 2) + 1": "expected one of",
    "normal(1)": "expected normal(mean, sd)",
    "normal(1, 2, 3)": "expected normal(mean, sd)",
    "normal(1,)": "expected normal(mean, sd)",
    "normal(a, 1)": "expected a number for mean, got 'a'",
    "normal(1 2, 1)": "expected a number for mean, got '1 2'",
    "normal(10 %, 1)": "percent: expected only for sd after a mean, or log_sd, got '10 %'",
    "halfnormal(5 %)": "percent: expected only",
    "uniform(1 %, 2)": "percent: expected only",
    "normal(0, 10 %)": "expected finite and > 0, got sd = 0.0",
    "normal(0, nan)": "expected finite and > 0, got sd = nan",
    "normal(inf, 1)": "expected finite, got mean = inf",
    "normal(0, 1e400)": "expected finite and > 0, got sd = inf",
    "lognormal(auto, 1)": "expected a number for median, got 'auto'",
    "lognormal(-1, 1)": "expected finite and > 0, got median = -1.0",
    "lognormal(1, x %)": "expected a number for log_sd, got 'x %'",
    "halfnormal(0)": "expected finite and > 0, got sd = 0.0",
    "gamma(2, -1)": "expected finite and > 0, got rate = -1.0",
    "uniform(2, 1)": "expected finite bounds, low < high, got low = 2.0, high = 1.0",
    "uniform(0, inf)": "expected finite bounds",
    "truncated(1, 0, 2)": "expected one of normal(mean, sd)",
    "truncated(normal(0, 1), 2, 1)": "expected low < high",
    "truncated(normal(0, 1), 0)": "expected truncated(DIST, low, high)",
    "truncated(lognormal(1, 1), -2, -1)": "expected low < high with some probability between",
    "truncated(truncated(normal(0, 1), 0, 1), 0, 1)": "a base that is not truncated itself",
    "empirical(none.csv, c)": "none.csv: no such file",
    "empirical(none.csv)": "expected empirical(FILE.csv, COLUMN)",
    "x" * 5_000: "expected one of",
    "truncated(" * 90: "expected one of",
    "normal(\x001, 2)": "expected a number for mean",
}


@pytest.mark.parametrize("text", BAD)
def test_parse__one_line_says_where_what_and_the_rule(tmp_path, text):
    with pytest.raises(InputError) as refused:
        parse_distribution(text, "p.toml: [hybrid] c1", folder=tmp_path)
    message = str(refused.value)
    assert message.startswith("p.toml: [hybrid] c1")
    assert BAD[text] in message
    assert "\n" not in message
    assert message.isprintable()
    assert len(message) < 500
