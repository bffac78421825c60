"""Known values of the statistics that actcheck computes itself, made with scipy and statsmodels.

    pip install scipy statsmodels
    python tests/data/statistics.py > tests/data/statistics.json

`tests/statistics.rs` compares the program with them.
"""

import json
import random

import scipy
import statsmodels
from scipy.stats import fisher_exact
from statsmodels.stats.contingency_tables import mcnemar
from statsmodels.stats.multitest import multipletests
from statsmodels.stats.proportion import proportion_confint

RANDOM = random.Random(20210831)


def wilson():
    counts = [(0, 1), (1, 1), (0, 20), (20, 20), (1, 29), (15, 148), (81, 263), (37, 52), (1, 1_000_000)]
    counts += [(RANDOM.randint(0, n), n) for n in (2, 3, 5, 8, 13, 52, 300, 1_000, 4_567, 100_000, 123_456_789)]
    for passed, runs in counts:
        low, high = proportion_confint(passed, runs, alpha=0.05, method="wilson")
        yield {"passed": passed, "runs": runs, "low": low, "high": high}


def fisher():
    tables = [
        (3, 1, 1, 3),  # Fisher's lady tasting tea
        (2, 10, 15, 3),
        (0, 5, 5, 0),
        (0, 0, 4, 7),
        (0, 4, 0, 7),
        (10, 10, 10, 10),
        (1, 9, 11, 3),
        (37, 15, 80, 868),
        (180, 20, 1_000, 8_800),
        (0, 300, 40, 9_660),
        (6_000, 14_000, 20_000, 160_000),
        (6_000, 14_000, 19_400, 45_600),
        (900, 1_100, 4_600, 5_400),
    ]
    for n in (4, 12, 40, 40, 200, 200, 3_000, 50_000):
        tables.append(tuple(RANDOM.randint(0, n) for _ in range(4)))
    for a, b, c, d in tables:
        p = {
            side: fisher_exact([[a, b], [c, d]], alternative=side).pvalue for side in ("greater", "less", "two-sided")
        }
        yield {
            "table": [a, b, c, d],
            "greater": p["greater"],
            "less": p["less"],
            "two_sided": p["two-sided"],
        }


def paired():
    tables = [(1, 1, 7, 12), (59, 6, 16, 80), (101, 121, 59, 33), (0, 0, 0, 5), (30, 5, 5, 30), (0, 9, 0, 0)]
    for n in (6, 25, 25, 100, 1_000):
        tables.append(tuple(RANDOM.randint(0, n) for _ in range(4)))
    for both, only_first, only_second, neither in tables:
        found = mcnemar([[both, only_first], [only_second, neither]], exact=True)
        yield {"table": [both, only_first, only_second, neither], "two_sided": float(found.pvalue)}


def corrected():
    lists = [[0.01, 0.04, 0.03, 0.005], [0.9, 0.6], [0.2], [0.05] * 5, [0.0, 1.0, 0.5]]
    lists += [[RANDOM.random() ** 3 for _ in range(n)] for n in (7, 20, 60)]
    for probabilities in lists:
        yield {
            "probabilities": probabilities,
            "benjamini_hochberg": list(multipletests(probabilities, method="fdr_bh")[1]),
            "holm": list(multipletests(probabilities, method="holm")[1]),
        }


print(
    json.dumps(
        {
            "made_with": {"scipy": scipy.__version__, "statsmodels": statsmodels.__version__},
            "wilson": list(wilson()),
            "fisher": list(fisher()),
            "paired": list(paired()),
            "corrected": list(corrected()),
        },
        indent=1,
    )
)
