"""What readers with a keyboard, a screen reader or weak eyes need, looked for in an open page (WCAG 2.2, level AA)."""

SCRIPT = r"""
() => {
  const found = [];
  const all = (selector) => [...document.querySelectorAll(selector)];
  const report = (what, element) => found.push(`${what}: ${element ? element.outerHTML.slice(0, 120) : ""}`);
  const named = (element) => {
    const text = element.matches("a, [role=region]") ? element.textContent : "";
    return (element.getAttribute("aria-label") || text).trim();
  };

  if (!document.documentElement.lang) report("no language");
  if (!document.title.trim()) report("no title");
  if (all("main").length !== 1) report("not one main landmark");
  if (all("h1").length !== 1) report("not one h1");
  let last = 0;
  for (const heading of all("h1, h2, h3, h4, h5, h6")) {
    const level = Number(heading.tagName[1]);
    if (level > last + 1) report("heading skips a level", heading);
    last = level;
  }
  const seen = new Set();
  for (const element of all("[id]")) {
    if (seen.has(element.id)) report("id twice", element);
    seen.add(element.id);
  }
  for (const element of all("[aria-labelledby]"))
    if (!seen.has(element.getAttribute("aria-labelledby"))) report("label is missing", element);
  for (const link of all('a[href^="#"]'))
    if (!seen.has(decodeURIComponent(link.hash.slice(1)))) report("link leads nowhere", link);
  for (const image of all("img")) {
    if (!image.alt.trim()) report("picture without text", image);
    if (!image.naturalWidth) report("picture is missing", image);
  }
  for (const element of all("figure"))
    if (!element.querySelector("figcaption")) report("figure without caption", element);
  for (const element of all("a, [tabindex='0'], [role=img], [role=listbox], [role=option], [role=region]"))
    if (!named(element)) report("no name", element);
  for (const element of all("[tabindex]"))
    if (element.tabIndex > 0) report("order of focus is forced", element);
  for (const list of all("[role=listbox]"))
    if (list.querySelectorAll("[tabindex='0']").length !== 1) report("list cannot be reached by tab", list);
  for (const cell of all("th"))
    if (!["col", "row"].includes(cell.scope)) report("table header without scope", cell);
  for (const table of all("table"))
    if (!table.caption) report("table without caption", table);
  for (const element of all("body *"))
    if (["auto", "scroll"].includes(getComputedStyle(element).overflowX) && element.tabIndex < 0)
      report("scrolls, but not by keyboard", element);

  const rgb = (text) => text.match(/[\d.]+/g).map(Number);
  const light = (color) => {
    const [r, g, b] = color.slice(0, 3).map((c) => c / 255)
      .map((c) => (c <= 0.04045 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4));
    return 0.2126 * r + 0.7152 * g + 0.0722 * b;
  };
  const behind = (element) => {
    for (; element; element = element.parentElement) {
      const color = rgb(getComputedStyle(element).backgroundColor);
      if (color.length < 4 || color[3] > 0) return color;
    }
    return [255, 255, 255];
  };
  const walker = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  while (walker.nextNode()) {
    const element = walker.currentNode.parentElement;
    if (!walker.currentNode.data.trim() || element.closest("script, style, noscript, title")) continue;
    const style = getComputedStyle(element);
    const pair = [light(rgb(element.closest("svg") ? style.fill : style.color)), light(behind(element))];
    const contrast = (Math.max(...pair) + 0.05) / (Math.min(...pair) + 0.05);
    if (contrast < 4.5) report(`contrast of ${contrast.toFixed(1)}`, element);
  }
  return found;
}
"""
