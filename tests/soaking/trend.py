"""Trends of samples: the slope of Theil and Sen, with an interval."""

import math
import statistics

# The normal deviate of a two-sided interval of 95 %.
DEVIATE = 1.96


class Trend:
    """A straight line through samples, which a few outliers do not change."""

    def __init__(self, times, values):
        self.mean = statistics.fmean(values)
        self.most = max(values)
        self.seconds = times[-1] - times[0]
        slopes = sorted((y - x) / (t - s) for i, (s, x) in enumerate(zip(times, values))
                        for t, y in zip(times[i + 1:], values[i + 1:]))
        self.slope = statistics.median(slopes)
        # By Sen (1968), from the number of independent samples.
        count = independent(times, values, self.slope)
        spread = math.sqrt(count * (count - 1) * (2 * count + 5) / 18) / (count * (count - 1) / 2)
        half = DEVIATE * spread / 2
        self.low, self.high = (quantile(slopes, 0.5 + side * half) for side in (-1, 1))

    @property
    def growth(self):
        """The growth over the time of the samples."""
        return self.slope * self.seconds

    @property
    def grows(self):
        """Whether the samples show a growth that is not by chance."""
        return self.low > 0


def independent(times, values, slope):
    """The number of independent samples: less than all of them if neighbours are alike, as those of a saw are."""
    rest = [value - slope * time for time, value in zip(times, values)]
    middle = statistics.fmean(rest)
    rest = [value - middle for value in rest]
    power = sum(value * value for value in rest)
    alike = sum(one * other for one, other in zip(rest, rest[1:])) / power if power else 0
    alike = min(max(alike, 0), 0.9)
    return max(len(values) * (1 - alike) / (1 + alike), 3)


def quantile(ordered, share):
    """A quantile of ordered values."""
    place = min(max(share, 0), 1) * (len(ordered) - 1)
    return ordered[round(place)]
