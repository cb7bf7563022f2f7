"""The contact sheet of an audition."""

import numpy as np
from mcap_landmarks.evaluation.audition import Audition, Heard
from mcap_landmarks.report.audition_sheet import Cell, cut_out, sheet

GREY = np.full((20, 10, 3), 128, np.uint8)
GREEN, ORANGE, RED = [0, 158, 115], [230, 159, 0], [213, 94, 0]


def test_a_cell_stands_at_its_distance_and_says_what_came_of_it() -> None:
    heard = Heard(2, 0, "person", 0.9, 5, True), Heard(4, 0, "", 0.0, 1, False), Heard(4, 0, "bench", 0.4, 1, False)
    auditions = [Audition("person", "coat", heard[:2]), Audition("person", "legs", heard[2:])]
    picture = sheet(auditions, [[Cell(GREY, heard[0]), Cell(GREY, heard[1])], [Cell(GREY, heard[2])]])
    rows, columns = 24 + 1, 150 + 1
    assert picture[rows, columns].tolist() == GREEN
    assert picture[rows, columns + 128].tolist() == RED
    assert picture[rows + 128 + 36, columns + 128].tolist() == ORANGE
    assert picture[rows + 128 + 36, columns].tolist() == [255, 255, 255]  # it was not seen from 2 m
    assert picture[rows + 64, columns + 64].tolist() == [128, 128, 128]


def test_the_part_around_a_box_is_cut_at_the_images_border() -> None:
    image = np.zeros((100, 200, 3), np.uint8)
    assert cut_out(image, np.array([100.0, 40.0, 120.0, 60.0])).shape == (34, 34, 3)
    assert cut_out(image, np.array([0.0, 40.0, 20.0, 60.0])).shape == (34, 27, 3)
