// Energy ellipse of the impact that is pointed at or focused; thesis_lib/report/critique/impacts.py explains the data.
"use strict";
// size and colour of points by their errors in m/s; a solve that failed has no error, not none
function paint(points, errors, { top, radii, colors }) {
  points.forEach((point, i) => {
    const failed = errors[i] === null;
    const share = failed ? 1 : Math.sqrt(Math.min(errors[i] / top, 1));
    point.setAttribute("r", (radii[0] + (radii[1] - radii[0]) * share).toFixed(1));
    point.setAttribute("fill", failed ? "#fff" : colors[Math.round((colors.length - 1) * share)]);
  });
}

for (const figure of document.querySelectorAll("figure.impacts")) {
  const { unit, impacts } = JSON.parse(figure.querySelector("script").textContent);
  const list = figure.querySelector("[role=listbox]");
  const points = [...list.querySelectorAll("[role=option]")];
  const ring = figure.querySelector(".ring");
  const panel = figure.querySelector("svg[role=img]");
  const told = figure.querySelector(".told");
  const frame = { left: 66, top: 34, width: 342, height: 300 };
  let chosen = -1;

  const write = (value) => String(Number(value.toPrecision(3))).replace("-", "−");
  const pair = (c) => `(${write(c[0])}, ${write(c[1])}) ${unit}`;

  function ticks(low, high, count) {
    const rough = (high - low) / count;
    const power = 10 ** Math.floor(Math.log10(rough));
    const step = power * [1, 2, 5, 10].find((factor) => factor * power >= rough);
    const found = [];
    for (let i = Math.ceil(low / step); i * step <= high; i++) found.push(i * step);
    return found;
  }

  function draw(one) {
    // half the height and width of a turned ellipse
    const turn = (one.angle * Math.PI) / 180;
    const half = [
      Math.hypot(one.axes[0] * Math.cos(turn), one.axes[1] * Math.sin(turn)),
      Math.hypot(one.axes[0] * Math.sin(turn), one.axes[1] * Math.cos(turn)),
    ];
    const seen = [[0, 0], one.measured, one.base, ...(one.final ? [one.final] : [])];
    const low = [0, 1].map((k) => Math.min(one.centre[k] - half[k], ...seen.map((c) => c[k])));
    const high = [0, 1].map((k) => Math.max(one.centre[k] + half[k], ...seen.map((c) => c[k])));
    const scale = 0.92 * Math.min(frame.width / (high[0] - low[0]), frame.height / (high[1] - low[1]));
    const x = (c) => frame.width / 2 + scale * (c - (low[0] + high[0]) / 2);
    const y = (c) => frame.height / 2 - scale * (c - (low[1] + high[1]) / 2);
    const at = (c) => `${x(c[0]).toFixed(1)} ${y(c[1]).toFixed(1)}`;
    const line = (kind, angle) =>
      `<path class="line ${kind}" d="M-999 0H999" transform="translate(${at(one.centre)}) rotate(${-angle})"/>`;
    const shapes = {
      measured: (p) => `<circle class="measured" r="4" transform="translate(${p})"/>`,
      base: (p) => `<path class="base" d="M0-6L6 0L0 6L-6 0Z" transform="translate(${p})"/>`,
      final: (p) => `<rect class="final" x="-4" y="-4" width="8" height="8" transform="translate(${p})"/>`,
    };
    const names = { measured: "measured", base: "base law", final: "with the effects" };
    const kinds = Object.keys(names).filter((kind) => one[kind]);
    let key = "";
    kinds.forEach((kind, i) => {
      const place = frame.left + [8, 98, 182][i];
      key += `${shapes[kind](`${place} 14`)}<text x="${place + 11}" y="18">${names[kind]}</text>`;
    });
    const inner =
      `<path class="axis" d="M${x(0)} 0V${frame.height}M0 ${y(0)}H${frame.width}" opacity=".35"/>` +
      `<ellipse class="ellipse" rx="${scale * one.axes[0]}" ry="${scale * one.axes[1]}" ` +
      `transform="translate(${at(one.centre)}) rotate(${-one.angle})"/>` +
      line("sticking", one.sticking) + line("compression", one.compression) +
      `<path class="gap" d="M${at(one.measured)}L${at(one.base)}"/>` +
      (one.final ? `<path class="gap to-final" d="M${at(one.measured)}L${at(one.final)}"/>` : "") +
      kinds.reverse().map((kind) => shapes[kind](at(one[kind]))).join("");
    const shift = [frame.width, frame.height].map((size) => size / 2 / scale);
    const middle = [0, 1].map((k) => (low[k] + high[k]) / 2);
    const bottom = frame.top + frame.height;
    let marks = "";
    for (const c of ticks(middle[0] - shift[0], middle[0] + shift[0], 6)) {
      const p = (frame.left + x(c)).toFixed(1);
      marks += `<path class="axis" d="M${p} ${bottom}v4"/><text x="${p}" y="${bottom + 17}" text-anchor="middle">` +
        `${write(c)}</text>`;
    }
    for (const c of ticks(middle[1] - shift[1], middle[1] + shift[1], 6)) {
      const p = frame.top + y(c);
      marks += `<path class="axis" d="M${frame.left} ${p.toFixed(1)}h-4"/>` +
        `<text x="${frame.left - 7}" y="${(p + 4).toFixed(1)}" text-anchor="end">${write(c)}</text>`;
    }
    panel.innerHTML =
      `${key}<path class="axis" d="M${frame.left} ${frame.top}V${bottom}H${frame.left + frame.width}"/>${marks}` +
      `<svg x="${frame.left}" y="${frame.top}" width="${frame.width}" height="${frame.height}">${inner}</svg>` +
      `<text x="${frame.left + frame.width / 2}" y="${bottom + 38}" text-anchor="middle">` +
      `impulse along the surface (${unit})</text>` +
      `<text transform="translate(13 ${frame.top + frame.height / 2}) rotate(-90)" text-anchor="middle">` +
      `impulse upward (${unit})</text>`;
  }

  function show(i) {
    if (i === chosen) return;
    if (chosen >= 0) {
      points[chosen].setAttribute("aria-selected", "false");
      points[chosen].tabIndex = -1;
    }
    chosen = i;
    points[i].setAttribute("aria-selected", "true");
    points[i].tabIndex = 0;
    for (const key of ["cx", "cy"]) ring.setAttribute(key, points[i].getAttribute(key));
    ring.setAttribute("r", Number(points[i].getAttribute("r")) + 4);
    const one = impacts[i];
    draw(one);
    const known = one.held_out ? "held out" : "used in the fit";
    const better = one.final ? `, with the effects ${pair(one.final)}` : "";
    const error = one.final ? `, with the effects ${write(one.errors[1])} m/s` : "";
    told.textContent =
      `Trial ${one.trial}, impact ${one.impact} (${known}). Impulse along the surface and upward: measured ` +
      `${pair(one.measured)}; predicted by the base law ${pair(one.base)}${better}. Error of the velocity after ` +
      `impact: ${write(one.errors[0])} m/s${error}.`;
    panel.setAttribute("aria-label", `Energy ellipse. ${told.textContent}`);
  }

  // Points stand in the order of their errors; the arrow keys go to the next one on the map.
  const order = ["cx", "cy"].map((key) =>
    points.map((_, i) => i).sort((a, b) => points[a].getAttribute(key) - points[b].getAttribute(key)));
  const rank = order.map((sorted) => {
    const places = [];
    sorted.forEach((i, place) => { places[i] = place; });
    return places;
  });
  const steps = { ArrowLeft: [0, -1], ArrowRight: [0, 1], ArrowUp: [1, -1], ArrowDown: [1, 1] };

  // on the figure: a listener for focus would make an SVG element itself a stop of the tab key
  for (const kind of ["pointerover", "focusin"]) {
    figure.addEventListener(kind, (event) => {
      const i = points.indexOf(event.target);
      if (i >= 0) show(i);
    });
  }
  list.addEventListener("keydown", (event) => {
    let next = { Home: points.length - 1, End: 0 }[event.key];
    const step = steps[event.key];
    if (step) {
      const [k, by] = step;
      next = order[k][Math.min(Math.max(rank[k][chosen] + by, 0), points.length - 1)];
    }
    if (next === undefined) return;
    event.preventDefault();
    points[next].focus();
  });
  show(points.length - 1);

  // switches: the map shows what each choice of effects leaves of the errors
  const panelOfSwitches = figure.querySelector(".switches");
  if (panelOfSwitches) {
    const { choices, ...scale } = JSON.parse(figure.querySelector("script").textContent);
    const boxes = [...panelOfSwitches.querySelectorAll("input")];
    const said = panelOfSwitches.querySelector("output");
    const of = figure.querySelector(".of");
    const update = () => {
      const one = choices.find(({ on }) => on.every((is, i) => is === boxes[i].checked));
      said.textContent = one.text;
      of.textContent = boxes.some((box) => box.checked) ? "error with these:" : "error of the base law:";
      paint(points, one.errors, scale);
      ring.setAttribute("r", Number(points[chosen].getAttribute("r")) + 4);
    };
    panelOfSwitches.hidden = false;
    panelOfSwitches.addEventListener("change", update);
    update();
  }
}
