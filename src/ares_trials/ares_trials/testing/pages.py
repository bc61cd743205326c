# SPDX-License-Identifier: Apache-2.0
"""Check pages in a browser, for tests only."""

from typing import Any

#: Themes, and window sizes (width, height) in px, in which pages are checked.
THEMES = ("light", "dark")
SIZES = {"wide": (1280, 900), "narrow": (390, 844)}

#: Script that lists every visible text: content, size, contrast, position.
TEXTS = """() => {
  const canvas = new OffscreenCanvas(1, 1).getContext("2d", { willReadFrequently: true });
  const paint = (colour) => {
    canvas.clearRect(0, 0, 1, 1);
    canvas.fillStyle = colour;
    canvas.fillRect(0, 0, 1, 1);
    return [...canvas.getImageData(0, 0, 1, 1).data];
  };
  const light = ([r, g, b]) => {
    const [x, y, z] = [r, g, b].map((c) => {
      const s = c / 255;
      return s <= 0.04045 ? s / 12.92 : ((s + 0.055) / 1.055) ** 2.4;
    });
    return 0.2126 * x + 0.7152 * y + 0.0722 * z;
  };
  const behind = (element) => {
    for (let e = element; e; e = e.parentElement) {
      const colour = paint(getComputedStyle(e).backgroundColor);
      if (colour[3] === 255) return colour;
    }
    return [255, 255, 255, 255];
  };
  const found = [];
  const walker = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  while (walker.nextNode()) {
    const node = walker.currentNode;
    const element = node.parentElement;
    if (!node.textContent.trim() || element.closest("script, style, noscript")) continue;
    const range = document.createRange();
    range.selectNodeContents(node);
    const box = range.getBoundingClientRect();
    if (box.width === 0 || !element.checkVisibility()) continue;
    const style = getComputedStyle(element);
    const svg = element.closest("svg");
    const ink = light(paint(svg ? style.fill : style.color));
    const ground = light(behind(svg ? svg.parentElement : element));
    found.push({
      text: node.textContent.trim().slice(0, 40), size: parseFloat(style.fontSize),
      contrast: (Math.max(ink, ground) + 0.05) / (Math.min(ink, ground) + 0.05),
      chart: svg !== null,
    });
  }
  return found;
}"""

#: Script that lists per visible figure: size, traces, labels that overlap or are cropped.
FIGURES = """() => [...document.querySelectorAll(".plot")]
  .filter((plot) => plot.checkVisibility()).map((plot) => {
  const frame = plot.getBoundingClientRect();
  const words = [...plot.querySelectorAll("svg text")]
    .map((text) => [text.textContent, text.getBoundingClientRect()])
    .filter(([text, box]) => text && box.width > 0);
  const cropped = words.filter(([, box]) => box.left < frame.left - 1 || box.right > frame.right + 1
    || box.top < frame.top - 1 || box.bottom > frame.bottom + 1);
  const overlapping = [];
  words.forEach(([one, a], i) => words.slice(i + 1).forEach(([other, b]) => {
    const across = Math.min(a.right, b.right) - Math.max(a.left, b.left);
    const down = Math.min(a.bottom, b.bottom) - Math.max(a.top, b.top);
    if (across > 1 && down > 2) overlapping.push(`${one} | ${other}`);
  }));
  const drawn = [...plot.querySelectorAll(".trace.scatter")].filter((trace) =>
    [...trace.querySelectorAll("path")].some((path) => {
      const box = path.getBoundingClientRect();
      return box.width + box.height > 0;
    }));
  const svg = plot.querySelector("svg").getBoundingClientRect();
  return {
    key: plot.dataset.key, width: svg.width, height: svg.height, traces: drawn.length,
    cropped: cropped.map(([text]) => text), overlapping, words: words.length,
    data: plot.data.map(({ x, y }) => [x, y]),
  };
})"""

#: End of a flight's track on the globe, px of the page: of the first whose name begins so.
PLACE = """(name) => {
  const flight = globe.flights.find((one) => one.name.startsWith(name));
  const box = globe.canvas.getBoundingClientRect();
  const last = flight.height.length - 1;
  const [x, y] = globe.at(flight.ground, last, 1 + flight.height[last]);
  return [box.left + x, box.top + y];
}"""

#: Least contrast of a text with its background; least font size, px.
LEAST_CONTRAST = 4.5
LEAST_FONT_PX = 12.0
#: Least fraction of the page's width that a figure fills; width in px beyond which it need not.
LEAST_SHARE, WIDEST = 0.75, 480


def illegible(page: Any, size: str, widest: int = WIDEST) -> list[str]:
    """List texts and figures that cannot be read, or only by scrolling.

    Args:
        page: of a browser.
        size: of SIZES.
        widest: width beyond which a figure need not grow, px.

    Returns:
        A line for each; empty if there are none.
    """
    found = []
    if not page.evaluate("document.documentElement.scrollWidth <= innerWidth"):
        found.append("the page is wider than its window")
    for figure in page.evaluate(FIGURES):
        if figure["width"] <= LEAST_SHARE * min(SIZES[size][0], widest):
            found.append(f"{figure['key']} is {figure['width']} px wide")
        found += [
            f"{figure['key']}: {what}: {figure[what]}"
            for what in ("cropped", "overlapping")
            if figure[what]
        ]
    found += [
        f"{text['text']!r}: contrast {text['contrast']}, {text['size']} px"
        for text in page.evaluate(TEXTS)
        if text["contrast"] < LEAST_CONTRAST or text["size"] < LEAST_FONT_PX
    ]
    if not all(page.locator(".axis").all_inner_texts()):
        found.append("an axis has no name")
    return found
