import re

import numpy as np
import pytest
from PIL import Image

from aug3d_core.report.html import duration, number, page, percent, picture, slider, spaced, table, tag


def test_text_is_escaped_where_it_must_be():
    assert tag("a", "x", class_='"<') == '<a class="&quot;&lt;">x</a>'
    assert spaced("<b>_c") == "&lt;b&gt; c"
    assert number("<b>") == "&lt;b&gt;"


def test_numbers_as_people_read_them():
    cases = {None: "-", True: "yes", 1234567: "1,234,567", 0.123456: "0.1235", 123456.7: "123,457", 21.404: "21.4"}
    assert [number(value) for value in cases] == list(cases.values())


def test_durations_as_people_say_them():
    seconds = (0.04, 99.94, 119.6, 3599.7, 7322.0)
    assert [duration(s) for s in seconds] == ["0.0 s", "99.9 s", "2 min 00 s", "1 h 00 min", "2 h 02 min"]


def test_tables_have_every_cell_and_mark_numbers():
    made = table(("a", "b"), [("1", "2"), ("3", "4")], numeric=(1,))
    assert re.findall(r"<td[^>]*>(\d)</td>", made) == ["1", "2", "3", "4"]
    assert made.count('class="num"') == 3


def test_pictures_travel_inside_the_page(tmp_path):
    Image.new("RGB", (7, 11), (200, 30, 30)).save(tmp_path / "a.png")
    Image.new("RGB", (7, 11), (200, 30, 30)).save(tmp_path / "b.jpg")
    assert 'src="data:image/png;base64,' in picture(tmp_path / "a.png", "one")
    assert 'src="data:image/jpeg;base64,' in picture(tmp_path / "b.jpg", 'say "two"')
    assert 'alt="say &quot;two&quot;"' in picture(tmp_path / "b.jpg", 'say "two"')


@pytest.mark.parametrize(
    ("size", "kind"),
    [
        ((1499, 900), "small"),
        ((1500, 1900), "large"),
        ((1000, 500), "large"),
        ((1000, 501), "small"),
        ((900, 90), "small"),
    ],
)
def test_sheets_and_strips_take_the_whole_width(tmp_path, size, kind):
    Image.new("RGB", size).save(tmp_path / "a.png")
    assert picture(tmp_path / "a.png", "one").startswith(f'<figure class="{kind}">')


def test_a_film_plays_inside_the_page_and_its_name_is_escaped(tmp_path):
    (tmp_path / "a.webm").write_bytes(b"film")
    page = picture(tmp_path / "a.webm", 'a "flight"')
    assert '<video src="data:video/webm;base64,ZmlsbQ=="' in page and 'title="a &quot;flight&quot;"' in page
    assert {"loop", "muted", "controls"} <= set(page.replace('=""', "").split())


def test_a_slider_lies_over_two_pictures(tmp_path):
    for name, shade in (("a", 0), ("b", 200)):
        Image.new("RGB", (8, 6), (shade, 30, 30)).save(tmp_path / f"{name}.png")
    page = slider(tmp_path / "a.png", tmp_path / "b.png", "photo <1>", "predicted", "photograph")
    assert page.index('alt="photograph"') < page.index('alt="predicted"'), "what is above comes last"
    assert page.count("data:image/png") == 2 and "photo &lt;1&gt;" in page and 'type="range"' in page


def test_a_share_is_never_told_as_nothing_when_it_is_little():
    shares = (None, 0.0, 0.0001, 0.004, 0.0051, 0.5, 1.0)
    assert [percent(share) for share in shares] == ["-", "0 %", "under 1 %", "under 1 %", "1 %", "50 %", "100 %"]
    assert percent(0.0004, 1) == "under 0.1 %" and percent(0.12345, 1) == "12.3 %"


def test_large_pictures_are_embedded_smaller_and_say_their_size(tmp_path):
    noise = np.random.default_rng(0).integers(0, 255, (300, 400, 3), np.uint8)
    Image.fromarray(noise).save(tmp_path / "a.png")
    page = picture(tmp_path / "a.png", "noise", 200)
    assert 'width="200" height="150"' in page and "image/jpeg" in page


def test_every_page_prints_its_colours():
    assert "print-color-adjust:exact" in page("title", "")
