"""What the generated Python clients share: all modules are imported, and the numbers of both must agree."""

import importlib
import pkgutil


def all_modules(package):
    """Imports all modules of a package."""
    names = [module.name for module in pkgutil.walk_packages(package.__path__, package.__name__ + ".")]
    for name in names:
        importlib.import_module(name)
    assert len(names) > 200, len(names)


def agree(history, table, statistics):
    """Three runs, whose mean is in the statistics. The last run is that of the history."""
    assert history[-1] == table[-1], (history, table)
    assert len(table) == 3, table
    assert abs(sum(table) / 3 / statistics - 1) < 1e-9, (table, statistics)
