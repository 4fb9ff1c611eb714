"""Cost of accuracy in time: settings of each method, their error and their run time.

`measured` times a `Setting`; `loads` and `posteriors` list settings.

>>> from ridgebayes.checks.cost.measured import Setting, measure
>>> (row,) = measure(Setting("pi", "fraction", "22/7", lambda: {"value": 22 / 7 - 3.14159}, "pi"))
>>> row["status"], round(row["error"], 4)
('ok', 0.0013)
"""
