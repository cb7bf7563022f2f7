"""The thesis's figures of positions and their errors show what was scored."""

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from mcap_landmarks.report.drawing import gather
from mcap_landmarks.report.error_plots import errors_figure, positions_figure

APPENDIX_D = Path(__file__).parents[1] / "data" / "thesis_appendix_d.txt"


def test_positions_stand_beside_the_truth() -> None:
    drawing, _ = gather([APPENDIX_D], aligned=False)
    truth, computed = positions_figure(drawing, "Figure 5.3").axes[0].get_lines()
    assert (truth.get_label(), computed.get_label()) == ("ground truth", "computed")
    apart = np.hypot(*(np.asarray(computed.get_xydata()) - np.asarray(truth.get_xydata())).T)
    assert np.sqrt(np.mean(apart**2)).round(3) == 0.106  # recomputed from Appendix D


def test_boxes_stand_at_the_median_error_of_each_axis_and_say_it() -> None:
    drawing, _ = gather([APPENDIX_D], aligned=False)
    panels = errors_figure(drawing).axes
    assert [axes.texts[0].get_text() for axes in panels] == ["+0.0101 m", "-0.0145 m"]
    signed = [float(np.median(line)) for axes in panels for line in _medians(axes)]
    np.testing.assert_allclose(signed, [0.0101, -0.0145], atol=5e-5)


def _medians(axes: Axes) -> list[np.ndarray]:
    return [np.asarray(line.get_xdata()) for line in axes.get_lines() if line.get_color() == "#DC2626"]
