import math

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from tautwave.report.run.contacts import find_contacts


def test_start_duration_peaks():
    time = np.arange(1000) * 1e-3
    effort, depth = np.zeros(1000), np.full(1000, -1.0)
    effort[100:200], depth[100:200] = -3.0, 2e-3
    effort[150], depth[160] = -5.0, 4e-3
    (contact,) = find_contacts(time, effort, depth)
    assert math.isclose(contact.start_s, 0.1)
    assert math.isclose(contact.duration_s, 0.1)
    assert contact.peak_effort == 5.0
    assert contact.peak_depth == 4e-3
    assert (contact.first, contact.last) == (100, 199)


def test_contact_at_both_ends_of_the_recording():
    effort = np.zeros(100)
    effort[:10] = effort[-10:] = 1.0
    first, last = find_contacts(np.arange(100) * 1e-2, effort)
    assert first.first == 0
    assert last.last == 99
    assert math.isnan(first.peak_depth)


def test_a_chatter_shorter_than_ten_milliseconds_is_one_contact():
    effort = np.zeros(100)
    effort[[10, 15, 18]] = 1.0
    effort[50] = 2.0
    assert [c.first for c in find_contacts(np.arange(100) * 1e-3, effort)] == [10, 50]


@given(st.lists(st.sampled_from([0.0, 1.0, -2.0, math.nan]), min_size=1, max_size=80))
def test_every_touching_row_lies_in_exactly_one_contact(efforts):
    effort = np.array(efforts)
    found = find_contacts(np.arange(len(effort)) * 1e-3, effort, merge_s=0.0)
    inside = [row for c in found for row in range(c.first, c.last + 1)]
    assert sorted(set(inside)) == inside
    touching = np.flatnonzero(np.isfinite(effort) & (effort != 0.0)).tolist()
    assert set(touching) <= set(inside)


def test_nothing_touched():
    assert find_contacts(np.arange(5.0), np.zeros(5)) == []
