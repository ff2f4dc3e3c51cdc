// Turns the body with its hits, and replays tosses; thesis_lib/report/critique/body.py and replay.py explain the data.
"use strict";
const dataOf = (figure) => JSON.parse(figure.querySelector("script").textContent);
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];

// unit vectors to the right, upwards and towards the reader
function axesOfView(azimuth, elevation) {
  const [ca, ce, sa, se] = [Math.cos, Math.sin].flatMap((f) => [azimuth, elevation].map((a) => f((a * Math.PI) / 180)));
  return [[-sa, ca, 0], [-se * ca, -se * sa, ce], [ce * ca, ce * sa, se]];
}

// which faces face the reader, and the paths of those that do and do not, from places in pixels
function drawnFaces(places, faces) {
  const paths = { front: "", back: "" };
  const isFront = faces.map((face) => {
    const corners = face.map((i) => places[i]);
    let area = 0;
    corners.forEach(([x, y], i) => {
      const [u, v] = corners[(i + 1) % corners.length];
      area += x * v - y * u;
    });
    paths[area < 0 ? "front" : "back"] += `M${corners.map(([x, y]) => `${x.toFixed(1)} ${y.toFixed(1)}`).join("L")}Z`;
    return area < 0;
  });
  return [isFront, paths];
}

for (const figure of document.querySelectorAll("figure.turned")) {
  const { vertices, faces, hits, beyond, axes, centre, scale, start, rungs } = dataOf(figure);
  const svg = figure.querySelector("svg");
  const part = (name) => svg.querySelector(`.${name}`);
  const circles = [...svg.querySelectorAll("[data-hit]")].sort((a, b) => a.dataset.hit - b.dataset.hit);
  const drawnAxes = ["x", "y", "z"].map((name) => svg.querySelector(`[data-axis=${name}]`));
  let angles = [...start];

  function turn(azimuth, elevation) {
    angles = [azimuth, Math.min(Math.max(elevation, -90), 90)];
    const view = axesOfView(...angles);
    const place = (r) => [centre[0] + scale * dot(view[0], r), centre[1] - scale * dot(view[1], r)];
    const put = (element, place, keys) => keys.forEach((key, i) => element.setAttribute(key, place[i].toFixed(1)));
    const [isFront, paths] = drawnFaces(vertices.map(place), faces);
    for (const name of ["front", "back"]) part(name).setAttribute("d", paths[name]);
    circles.forEach((circle, i) => put(circle, place(hits[i]), ["cx", "cy"]));
    axes.forEach(([from, to], i) => {
      const [line, name] = drawnAxes[i].children;
      line.setAttribute("d", `M${place(from).join(" ")}L${place(to).join(" ")}`);
      put(name, place(to), ["x", "y"]);
    });
    [...circles, ...drawnAxes].forEach((element, i) =>
      part(beyond[i].some((face) => isFront[face]) ? "before" : "behind").append(element));
  }

  if (rungs) {
    const [controls, choice] = ["p.controls", "select"].map((name) => figure.querySelector(name));
    const update = () => {
      const errors = rungs.errors[choice.value];
      paint(circles, errors, rungs);
      circles.forEach((circle, i) => {
        const said = circle.querySelector("title");
        said.textContent = said.textContent.replace(/:.*$/, `: ${errors[i] === null ? "no solution" : `${errors[i]} m/s`}`);
      });
    };
    choice.addEventListener("change", update);
    controls.hidden = false;
    if (Number(choice.value) !== rungs.errors.length - 1) update(); // as it was before the page was loaded again
  }

  svg.setAttribute("role", "application");
  svg.setAttribute("aria-label", `${svg.getAttribute("aria-label")} The arrow keys turn it.`);
  svg.setAttribute("tabindex", "0");
  svg.addEventListener("keydown", (event) => {
    const by = { ArrowLeft: [10, 0], ArrowRight: [-10, 0], ArrowUp: [0, -10], ArrowDown: [0, 10] }[event.key];
    if (!by && event.key !== "Home") return;
    event.preventDefault();
    if (by) turn(angles[0] + by[0], angles[1] + by[1]);
    else turn(...start);
  });
  let last = [0, 0];
  for (const kind of ["pointerdown", "pointermove"]) {
    svg.addEventListener(kind, (event) => {
      const here = [event.clientX, event.clientY];
      if (kind === "pointerdown") svg.setPointerCapture(event.pointerId);
      else if (!svg.hasPointerCapture(event.pointerId)) return;
      else turn(angles[0] - (here[0] - last[0]) / 2, angles[1] + (here[1] - last[1]) / 2);
      last = here;
    });
  }
}

for (const figure of document.querySelectorAll("figure.replay")) {
  const { vertices, faces, elevation, tosses } = dataOf(figure);
  const view = axesOfView(-90, elevation);
  const part = (name) => figure.querySelector(`.${name}`);
  const [choice, slider, play] = ["select", "input", "button"].map((name) => figure.querySelector(name));
  let toss;

  // the place in the axes of the surface of a point of the body: p + R(q) r
  function moved(r, [x, y, z, w, a, b, c]) {
    const cross = (u, v) => [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
    const q = [a, b, c];
    const once = cross(q, r);
    const twice = cross(q, once);
    return [x, y, z].map((p, i) => p + r[i] + 2 * (w * once[i] + twice[i]));
  }

  function outline(pose) {
    if (!pose) return "";
    const places = vertices.map((r) => moved(r, pose)).map((r) =>
      [toss.origin[0] + toss.scale * dot(view[0], r), toss.origin[1] - toss.scale * dot(view[1], r)]);
    return drawnFaces(places, faces)[1].front;
  }

  function show(frame) {
    slider.value = frame;
    part("solid").setAttribute("d", outline(toss.measured[frame]));
    part("ghost").setAttribute("d", outline(toss.predicted[frame]));
    part("now").setAttribute("transform", `translate(${toss.at[frame]})`);
    const predicted = toss.predicted[frame] ? `predicted ${toss.heights[1][frame]} mm` : "no prediction";
    const told = `${toss.t[frame]} s: lowest point measured ${toss.heights[0][frame]} mm, ${predicted}`.replaceAll("-", "−");
    slider.setAttribute("aria-valuetext", told);
    part("told").textContent = told;
  }

  function choose(i) {
    toss = tosses[i];
    for (const part of figure.querySelectorAll("[data-toss]")) part.toggleAttribute("hidden", part.dataset.toss !== `${i}`);
    slider.max = toss.t.length - 1;
    show(toss.first);
  }

  let began = null;
  function step(now) {
    if (began === null) return;
    const t = (now - began) / 4000; // a quarter of the speed
    const frame = toss.t.findLastIndex((one) => one <= t);
    show(Math.max(frame, 0));
    if (frame < toss.t.length - 1) requestAnimationFrame(step);
    else stop();
  }
  function stop() {
    began = null;
    play.textContent = "Play";
  }
  play.addEventListener("click", () => {
    if (began !== null) return stop();
    play.textContent = "Stop";
    const from = Number(slider.value) < toss.t.length - 1 ? toss.t[slider.value] : 0;
    began = performance.now() - 4000 * from;
    requestAnimationFrame(step);
  });
  choice.addEventListener("change", () => {
    stop();
    choose(choice.value);
  });
  slider.addEventListener("input", () => {
    stop();
    show(Number(slider.value));
  });
  part("controls").hidden = false;
  choose(0);
}
