"""Every page in headless Chromium, opened from its file: quiet, whole, usable by mouse and keyboard, printable."""

import json
import math
import re

import pytest
from accessibility import SCRIPT
from conftest import NARROW, WIDE

pytestmark = pytest.mark.slow
PAGES = ("run", "chapter", "critique", "space", "index", "claims")
# px at 96 an inch, of A4 less the margins that page.css gives
PAPER = dict.fromkeys(PAGES, (688, 1017)) | {"claims": (1032, 702)}


@pytest.mark.parametrize("name", PAGES)
@pytest.mark.parametrize("width", [WIDE, NARROW])
def test_it_is_quiet_asks_for_nothing_and_fits(visit, pages, name, width):
    opened = visit(pages[name], width)
    opened.page.wait_for_timeout(200)  # ms, for requests that a script would make late
    assert opened.complaints == []
    assert opened.requests == [pages[name].as_uri()]
    assert opened.page.evaluate("document.documentElement.scrollWidth") == width


@pytest.mark.parametrize("name", PAGES)
def test_readers_of_all_kinds_can_use_it(visit, pages, name):
    assert visit(pages[name]).page.evaluate(SCRIPT) == []


def test_pictures_are_there_and_say_their_captions(visit, pages):
    pictures = visit(pages["critique"]).page.evaluate(
        "[...document.images].map((i) => [i.naturalWidth, i.alt, i.parentElement.nextElementSibling.innerText])"
    )
    assert len(pictures) >= 7
    assert all(width > 0 and alt.endswith(caption) for width, alt, caption in pictures)


@pytest.mark.parametrize(
    ("spoil", "found"),
    [
        ("document.documentElement.lang = ''", "no language"),
        ("document.querySelector('h2').outerHTML = '<h4>x</h4>'", "skips a level"),
        ("document.images[0].alt = ' '", "picture without text"),
        ("document.images[0].src = 'data:image/png;base64,AAAA'", "picture is missing"),
        ("document.querySelector('figcaption').remove()", "without caption"),
        ("document.querySelector('th').removeAttribute('scope')", "without scope"),
        ("document.querySelector('caption').remove()", "table without caption"),
        ("document.querySelector('.scroll').removeAttribute('tabindex')", "not by keyboard"),
        ("document.querySelector('main p').style.color = '#888'", "contrast of 3.5"),
        ("document.querySelector('svg text').style.fill = '#bbb'", "contrast of 1.9"),
        ("document.querySelector('h2').id = 'main'", "id twice"),
        ("document.querySelector('nav a').setAttribute('href', '#nowhere')", "leads nowhere"),
        ("document.querySelector('[role=option][tabindex=\"0\"]').tabIndex = -1", "cannot be reached"),
        ("document.querySelector('nav a').tabIndex = 3", "order of focus"),
        ("document.querySelector('[role=img]').removeAttribute('aria-label')", "no name"),
    ],
)
def test_the_checks_find_what_is_spoilt(visit, pages, spoil, found):
    page = visit(pages["critique"]).page
    page.evaluate(spoil)
    page.wait_for_timeout(50)  # ms, for a picture that cannot be read
    assert any(found in one for one in page.evaluate(SCRIPT))


def test_a_page_that_asks_or_complains_is_noticed(visit, tmp_path):
    (tmp_path / "bad.html").write_text("<img src='http://localhost/x.png'><script>nothing.here</script>")
    opened = visit(tmp_path / "bad.html")
    assert "http://localhost/x.png" in opened.requests
    assert any("nothing is not defined" in one for one in opened.complaints)


@pytest.mark.parametrize("name", PAGES)
def test_foreign_scripts_and_sources_are_refused(visit, pages, name, tmp_path):
    """The text of a dataset is escaped; should that ever fail, the page's policy still stands in the way."""
    evil = "<img src='http://localhost/x.png'><script>document.title = 'taken over'</script></main>"
    (tmp_path / "evil.html").write_text(pages[name].read_text().replace("</main>", evil, 1))
    opened = visit(tmp_path / "evil.html")
    assert opened.page.title() != "taken over"
    refused = [said for said in opened.complaints if "Content Security Policy" in said]
    assert any("http://localhost/x.png" in said for said in refused) and len(refused) == 2


def shown(page) -> str:
    return page.locator(".impacts .told").inner_text()


def test_pointing_at_an_impact_shows_its_ellipse(visit, pages):
    page = visit(pages["critique"]).page
    assert shown(page).startswith("Trial ")  # that of the largest error, from the start
    told = set()
    for i in (0, 5, 20):
        point = page.locator("[role=option]").nth(i).element_handle()
        # others may lie on top of it
        point.evaluate("(one) => { one.parentNode.append(one); one.scrollIntoView({block: 'center'}); }")
        box = point.bounding_box()
        page.mouse.move(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
        label = point.get_attribute("aria-label")
        assert label.split(", error")[0].capitalize() in shown(page)
        assert point.get_attribute("aria-selected") == "true"
        told.add(shown(page))
    assert len(told) == 3
    assert page.locator("[aria-selected=true]").count() == 1


def test_switches_show_what_each_choice_of_effects_leaves(visit, pages):
    page = visit(pages["critique"]).page
    box, said = page.locator(".switches input").first, page.locator(".switches output")
    sizes = "points => points.reduce((sum, point) => sum + Number(point.getAttribute('r')), 0)"
    points = page.locator("figure.impacts [role=option]")
    drawn, without, size = points.first.get_attribute("fill"), said.inner_text(), points.evaluate_all(sizes)
    box.check()
    assert said.inner_text() != without and points.evaluate_all(sizes) < 0.9 * size
    box.uncheck()
    assert (points.first.get_attribute("fill"), said.inner_text()) == (drawn, without)
    assert points.evaluate_all(sizes) == pytest.approx(size)


def test_the_ellipse_is_drawn_where_its_numbers_say(visit, pages):
    page = visit(pages["critique"]).page
    data = json.loads(page.locator("figure.impacts script").text_content())
    one = data["impacts"][-1]
    ellipse = page.locator(".impacts ellipse.ellipse")
    scale = float(ellipse.get_attribute("rx")) / one["axes"][0]
    centre = place_of(ellipse)
    for kind in ("measured", "base", "final"):
        found = place_of(page.locator(f"svg svg .{kind}"))
        wanted = [
            centre[0] + scale * (one[kind][0] - one["centre"][0]),
            centre[1] - scale * (one[kind][1] - one["centre"][1]),
        ]
        assert found == pytest.approx(wanted, abs=0.2)  # px: places are written to a tenth
    turn = float(re.search(r"rotate\((.*?)\)", ellipse.get_attribute("transform"))[1])
    assert turn == pytest.approx(-one["angle"])
    assert f"{one['errors'][0]:.3g} m/s" in shown(page)


def place_of(element) -> list[float]:
    text = re.search(r"translate\((.*?)\)", element.get_attribute("transform"))[1]
    return [float(number) for number in text.split()]


def test_the_keyboard_reaches_every_impact(visit, pages):
    page = visit(pages["critique"]).page

    def focused(name: str) -> str | None:
        return page.evaluate(f"document.activeElement.getAttribute('{name}')")

    page.locator("figure.impacts .keys").click()  # tab goes on from here
    page.keyboard.press("Tab")
    assert focused("type") == "checkbox"
    page.keyboard.press("Tab")
    assert focused("role") == "option"
    first = shown(page)
    page.keyboard.press("End")
    assert shown(page) != first and focused("aria-label").split(", error")[0].capitalize() in shown(page)
    page.keyboard.press("Home")
    assert shown(page) == first
    for key, axis, way in (("ArrowLeft", "cx", -1), ("ArrowUp", "cy", -1), ("ArrowRight", "cx", 1)):
        before = float(focused(axis))
        page.keyboard.press(key)
        assert math.copysign(1, way) * (float(focused(axis)) - before) >= 0
    ring = page.locator(".ring")
    assert ring.get_attribute("cx") == focused("cx") and ring.get_attribute("cy") == focused("cy")
    assert ring.evaluate("(one) => getComputedStyle(one).strokeWidth") == "4px"
    count = page.locator("[role=option]").count()
    page.keyboard.press("Home")
    seen = {focused("aria-label")}
    for key in ["ArrowLeft"] * count + ["ArrowRight"] * count:
        page.keyboard.press(key)
        seen.add(focused("aria-label"))
    assert len(seen) == count


def test_tab_goes_first_to_the_link_that_skips(visit, pages):
    page = visit(pages["critique"]).page
    page.keyboard.press("Tab")
    assert page.evaluate("document.activeElement.getBoundingClientRect().left") >= 0
    page.keyboard.press("Enter")
    page.keyboard.press("Tab")
    assert page.evaluate("document.activeElement.closest('main') !== null")


@pytest.mark.parametrize("name", PAGES)
def test_it_prints_with_nothing_cut(visit, pages, name):
    width, height = PAPER[name]
    page = visit(pages[name], width).page
    page.emulate_media(media="print")
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    boxes = page.evaluate("[...document.querySelectorAll('figure')].map((f) => f.getBoundingClientRect().toJSON())")
    assert all(box["height"] <= height and box["right"] <= width for box in boxes)
    assert not page.locator("nav:visible, button:visible, .skip:visible, .keys:visible").count()
    pdf = page.pdf(prefer_css_page_size=True)
    landscape = re.search(rb"/MediaBox \[0 0 ([\d.]+) ([\d.]+)\]", pdf)
    assert pdf.startswith(b"%PDF") and landscape
    assert (float(landscape[1]) > float(landscape[2])) == (name == "claims")


@pytest.fixture
def still(browser):
    """A page without scripts, which opens where it is told to."""
    context = browser.new_context(java_script_enabled=False)
    yield context.new_page()
    context.close()


def test_without_a_script_the_text_is_there(still, pages):
    still.goto(pages["critique"].as_uri())
    text = still.locator("main").inner_text()
    assert "this page's script, which your browser does not run" in text
    assert "of the sum of all errors" in text


# --- bodies in space ---


def places(path: str) -> list[float]:
    return [float(number) for number in re.findall(r"-?[\d.]+", path)]


def drawn(page) -> dict[str, list[float]]:
    """What is drawn of the body: its faces, and the hits."""
    found = {name: places(page.locator(f".turned .{name}").get_attribute("d")) for name in ("front", "back")}
    hits = page.locator(".turned [data-hit]").evaluate_all(
        "(all) => all.sort((a, b) => a.dataset.hit - b.dataset.hit).flatMap((c) => [c.cx, c.cy])"
        ".map((x) => x.baseVal.value)"
    )
    return found | {"hits": hits}


def test_a_body_is_turned_by_keys_and_pointer_and_comes_back(visit, in_space, still):
    """The script draws the first view as the page has it; a turn by 360° changes nothing."""
    still.goto(in_space.as_uri())
    page, first = visit(in_space).page, drawn(still)
    body = page.locator(".turned svg")
    body.focus()
    page.keyboard.press("ArrowLeft")
    assert drawn(page)["hits"] != first["hits"]
    for keys in (["ArrowLeft"] * 35, ["ArrowUp"] * 3 + ["Home"]):
        for key in keys:
            page.keyboard.press(key)
        assert {name: pytest.approx(first[name], abs=0.11) for name in first} == drawn(page)
    box = body.bounding_box()
    page.mouse.move(box["x"] + 100, box["y"] + 100)
    page.mouse.down()
    page.mouse.move(box["x"] + 200, box["y"] + 100)
    page.mouse.up()
    turned = drawn(page)["hits"]
    assert turned != first["hits"]
    page.mouse.move(box["x"] + 50, box["y"] + 50)
    assert drawn(page)["hits"] == turned
    for _ in range(5):  # to the right, 100 px are 50°
        page.keyboard.press("ArrowLeft")
    assert drawn(page)["hits"] != turned
    page.keyboard.press("Home")
    assert drawn(page)["hits"] == pytest.approx(first["hits"], abs=0.11)


def test_hits_are_coloured_by_the_rung_that_is_chosen(visit, in_space):
    page = visit(in_space).page
    rungs = json.loads(page.locator("figure.turned script").text_content())["rungs"]
    least, most = rungs["radii"]
    choice = page.locator(".turned select")
    assert choice.input_value() == str(len(rungs["errors"]) - 1)
    for i, errors in enumerate(rungs["errors"]):
        choice.select_option(str(i))
        for hit in (0, len(errors) // 2, len(errors) - 1):
            circle = page.locator(f".turned [data-hit='{hit}']")
            share = min(errors[hit] / rungs["top"], 1.0) ** 0.5
            assert float(circle.get_attribute("r")) == pytest.approx(least + (most - least) * share, abs=0.06)
            assert circle.locator("title").text_content().endswith(f": {errors[hit]:g} m/s".replace("e-0", "e-"))


def test_tosses_are_replayed(visit, in_space, still):
    page = visit(in_space).page
    still.goto(in_space.as_uri())
    data = json.loads(page.locator("figure.replay script").text_content())
    for name in ("solid", "ghost"):
        first = page.locator(f".replay .{name}").get_attribute("d")
        assert places(first) == pytest.approx(places(still.locator(f".replay .{name}").get_attribute("d")), abs=0.11)
    slider, told = page.locator(".replay input"), page.locator(".replay .told")
    for i, toss in enumerate(data["tosses"]):
        page.locator(".replay select").select_option(str(i))
        assert page.locator("[data-toss]:not([hidden])").count() == 2
        slider.focus()
        page.keyboard.press("End")
        lowest = str(toss["heights"][0][-1]).replace("-", "−")
        assert told.inner_text().startswith(f"{toss['t'][-1]} s: lowest point measured {lowest} mm")
        page.keyboard.press("Home")
        assert "no prediction" in told.inner_text() and slider.get_attribute("aria-valuetext") == told.inner_text()
        assert page.locator(".replay .ghost").get_attribute("d") == ""
    play = page.locator(".replay button")
    play.click()
    while int(slider.input_value()) <= 2:  # the policy of the page allows no `wait_for_function`
        page.wait_for_timeout(50)
    assert play.inner_text() == "Stop"
    play.click()
    assert play.inner_text() == "Play"


def test_without_a_script_body_and_tosses_are_drawn_and_nothing_waits_for_it(still, in_space):
    still.goto(in_space.as_uri())
    assert still.locator(".turned [data-hit]").count() > 5 and still.locator(".replay .solid").get_attribute("d")
    assert not still.locator(".controls:visible").count()


def test_claims_are_searched_and_filtered_and_links_still_find_them(visit, pages):
    page = visit(pages["claims"]).page
    shown = "[...document.querySelectorAll('tr[data-status]')].filter((r) => r.offsetParent).map((r) => r.id)"
    names = [f"table_3_1.{name}" for name in ("holds", "deviates", "absent")]
    assert page.evaluate(shown) == names
    page.fill("input[type=search]", "TABLE_3_1 absent")
    assert page.evaluate(shown) == names[2:]
    assert page.inner_text("output") == "1 of 3 claims"
    page.fill("input[type=search]", "")
    page.uncheck("input[value=deviates]")
    assert page.evaluate(shown) == [names[0], names[2]]
    page.click(f"a[href='#{names[1]}']")  # to one that is hidden
    page.locator(f"tr[id='{names[1]}']").wait_for()
    assert page.evaluate(shown) == names
    page.fill("input[type=search]", "no such claim")
    assert page.inner_text("output") == "0 of 3 claims"
    assert not page.is_visible("h2")
