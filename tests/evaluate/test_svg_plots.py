"""Plots: well-formed, every peak kept."""

from xml.etree import ElementTree

import numpy as np

from motionserver.evaluate.svg import Curve, Panel, figure, spans_where

TIMES = np.arange(0.0, 100.0, 0.002)


def test_standalone_figure_is_well_formed_and_keeps_a_lone_peak():
    values = np.zeros_like(TIMES)
    values[30123] = 1.0
    drawn = figure([Panel("a < b & c", TIMES, [Curve("x", values, 1)])], standalone=True)
    tree = ElementTree.fromstring(drawn)
    paths = [e for e in tree.iter() if e.get("class") == "curve c1"]
    points = [p.split() for p in paths[0].get("d")[1:].split("L")]
    assert len(points) <= 1400
    heights = [float(y) for _, y in points]
    assert min(heights) < max(heights) - 100.0
    assert "a &lt; b &amp; c" in drawn


def test_flat_curves_limits_and_spans_are_drawn():
    panel = Panel("flat", TIMES[:10], [Curve("", np.ones(10), 0)], (2.0, -2.0), [(0.0, 0.01)])
    drawn = figure([panel, panel])
    assert drawn.count('class="limit"') == 4
    assert drawn.count('class="span"') == 2
    assert "nan" not in drawn


def test_spans_are_where_the_mask_holds():
    mask = np.array([True, False, True, True, False, True])
    assert spans_where(np.arange(6.0), mask) == [(0.0, 1.0), (2.0, 4.0), (5.0, 5.0)]
    assert spans_where(np.arange(3.0), np.zeros(3, bool)) == []
