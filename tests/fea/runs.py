"""Files of runs to tables, as `import` does it, for a body that a test gives."""

from ridgebayes.fea import abaqus_dat, abaqus_rpt, calculix, mesh_series
from ridgebayes.fea.deck import RunDeck
from ridgebayes.fea.history import table_of


def _deck(body, deck, surface, reaction):
    return RunDeck.read(deck, surface, reaction, E=body.E, nu=body.nu)


def read_calculix(path, body, *, deck, surface, reaction, sta=None, brackets=False):
    run = _deck(body, deck, surface, reaction)
    return table_of(calculix.read_calculix(path, deck=run, sta=sta), body, brackets=brackets)


def read_abaqus_dat(path, body, *, deck, surface, reaction, brackets=False):
    run = _deck(body, deck, surface, reaction)
    return table_of(abaqus_dat.read_abaqus_dat(path, deck=run), body, brackets=brackets)


def read_abaqus_rpt(path, body, *, brackets=False, **options):
    return table_of(abaqus_rpt.read_abaqus_rpt(path, **options), body, brackets=brackets)


def read_series(path, body, *, brackets=False, **options):
    paths = list(path) if isinstance(path, list | tuple) else [path]
    history = mesh_series.read_series(paths, R=body.R, **options)
    return table_of(history, body, brackets=brackets)
