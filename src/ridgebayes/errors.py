"""The few kinds of failure, so that a caller can tell a wrong input from a failed computation."""


class RidgebayesError(Exception):
    """Base of every error this package raises on purpose.

    Examples
    --------
    >>> import ridgebayes as rb
    >>> try:
    ...     rb.read_table("absent.csv")
    ... except rb.RidgebayesError as error:
    ...     print(type(error).__name__, error)
    InputError absent.csv: no such file
    """


class InputError(RidgebayesError, ValueError):
    """The input breaks a rule; the message names place, value and rule. Exit code 2.

    Examples
    --------
    >>> import ridgebayes as rb
    >>> rb.Scene.of([(0.022, -0.02)])
    Traceback (most recent call last):
    ridgebayes.errors.InputError: Texture: b_over_R = -0.02: input should be greater than 0
    """


class ComputationError(RidgebayesError, RuntimeError):
    """The input is valid, but the computation failed or did not converge. Exit code 1.

    Examples
    --------
    >>> import ridgebayes as rb
    >>> issubclass(rb.ComputationError, RuntimeError), issubclass(rb.ComputationError, ValueError)
    (True, False)
    """


class OutputError(RidgebayesError, OSError):
    """Results cannot be written: a full disk, a missing folder. Commands exit 1.

    Not a `ComputationError`: a failed form leaves the others, a full disk ends the run.
    """


class WorkerLostError(ComputationError):
    """Every worker process that was given a task died on it; the message names the task."""


class CautionWarning(UserWarning):
    """An answer that the table, an error model or a prior makes doubtful; the message says why.

    Examples
    --------
    >>> import ridgebayes as rb
    >>> issubclass(rb.CautionWarning, UserWarning)
    True
    """
