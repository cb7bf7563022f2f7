// The page of a report: draws what its data say, and goes from bundle to bundle. Texts out of logs are never HTML.
"use strict";

const data = JSON.parse(document.getElementById("data").textContent);
const runs = data.runs || [];
const statuses = data.statuses || [];
const GLYPHS = ["●", "◆", "■", "✕", "▲", "▼", "●", "○"];
const SYMBOLS = ["circle", "diamond", "square", "x", "triangle-up", "triangle-down", "circle", "circle-open"];
const CLASS_COLOURS = ["#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#9A73B8", "#8A8F98"];
const CLASS_SYMBOLS = ["cross", "star", "hexagon", "pentagon", "star-square", "bowtie", "hourglass", "star-diamond"];
const moments = momentsOf(runs);
let chosen = 0;

// ---- small things

const byId = (id) => document.getElementById(id);
const colour = (name) => getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();
const colourOf = (status) => colour(statuses[status].name);
// Plotly reads a part of HTML in texts: nothing out of a log may look like it.
const plain = (text) => String(text).replace(/&/g, "&amp;").replace(/</g, "&lt;").replace(/>/g, "&gt;");
const metres = (value) => value === null || value === undefined ? "–" : Math.abs(value) < 0.1 ? `${(1000 * value).toFixed(1)} mm` : `${value.toFixed(3)} m`;
const number = (value, digits) => value === null || value === undefined ? "–" : value.toFixed(digits);

function node(name, attributes, ...inside) {
  const svg = ["svg", "path", "rect", "circle", "ellipse", "line", "text", "g", "polygon", "title"].includes(name);
  const made = svg ? document.createElementNS("http://www.w3.org/2000/svg", name) : document.createElement(name);
  for (const [key, value] of Object.entries(attributes || {})) if (value !== null) made.setAttribute(key, value);
  made.append(...inside.filter((one) => one !== null));
  return made;
}

function unpacked(text) {
  const bytes = Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
  return Array.from(new Int16Array(bytes.buffer), (value) => value / 100);
}

function instant(stamp) {
  const whole = BigInt(stamp), rest = String(whole % 1000000000n).padStart(9, "0");
  const date = new Date(Number(whole / 1000000000n) * 1000);
  return isNaN(date) ? stamp : date.toISOString().slice(0, 19) + "." + rest + "Z";
}

// ---- moments: the bundles of all runs by their stamps

function momentsOf(all) {
  const found = new Map();
  all.forEach((run, side) => run.bundles.stamp.forEach((stamp, row) => {
    if (!found.has(stamp)) found.set(stamp, { stamp, t: run.bundles.t[row], rows: all.map(() => null) });
    found.get(stamp).rows[side] = row;
  }));
  return [...found.values()].sort((a, b) => a.t - b.t);
}

const momentAt = new Map(moments.map((one, place) => [one.stamp, place]));
const statusOf = (moment, side) => moment.rows[side] === null ? null : runs[side].bundles.status[moment.rows[side]];
const isFailure = (status) => status !== null && status >= 1 && status <= 5;
const changes = new Set((data.changes || []).map((one) => one.stamp));
const isOfNote = (moment) => runs.length > 1 ? changes.has(moment.stamp) : isFailure(statusOf(moment, 0));

function choose(place, focus) {
  if (!moments.length) return;
  chosen = Math.max(0, Math.min(moments.length - 1, place));
  const moment = moments[chosen];
  const said = runs.map((run, side) => {
    const status = statusOf(moment, side);
    return (runs.length > 1 ? `${data.sides[side]}: ` : "") + (status === null ? "no bundle" : statuses[status].words);
  }).join("; ");
  const words = `Bundle ${chosen + 1} of ${moments.length}, ${moment.t.toFixed(2)} s: ${said}`;
  byId("where").textContent = words;
  const strip = byId("strip");
  strip.setAttribute("aria-valuemax", moments.length - 1);
  strip.setAttribute("aria-valuenow", chosen);
  strip.setAttribute("aria-valuetext", words);
  byId("panels").replaceChildren(...runs.map((run, side) => panel(run, side, moment)));
  drawStrip();
  markChosen();
  for (const row of document.querySelectorAll("tr[data-stamp]")) row.classList.toggle("chosen", row.dataset.stamp === moment.stamp);
  if (focus) { byId("panels").scrollIntoView({ block: "nearest" }); byId("panels").firstChild.focus(); }
}

function chooseNext(fits) {
  for (let step = 1; step <= moments.length; step++) {
    const place = (chosen + step) % moments.length;
    if (fits(moments[place])) return choose(place);
  }
}

// ---- one bundle

function badge(status) {
  const made = node("span", { class: "status" }, node("span", { class: "glyph", "aria-hidden": "true" }, GLYPHS[status]), statuses[status].words);
  made.style.color = colourOf(status);
  return made;
}

function panel(run, side, moment) {
  const row = moment.rows[side];
  const title = node("h3", {}, runs.length > 1 ? `${data.sides[side]}: ${run.name}` : `At ${moment.t.toFixed(2)} s`);
  const made = node("section", { class: "panel", tabindex: "-1", "aria-label": `Bundle${runs.length > 1 ? " of the " + data.sides[side] : ""}` }, title);
  if (row === null) { made.append(node("p", { class: "soft" }, "This run has no bundle of this time on the page.")); return made; }
  const bundles = run.bundles, detail = bundles.detail[row] === null ? null : run.details[bundles.detail[row]];
  const off = bundles.off_m[row];
  made.append(node("p", {}, badge(bundles.status[row]), off === null ? "" : ` · off by ${metres(off)}, ${number(bundles.off_deg[row], 2)}°`));
  made.append(node("p", { class: "soft" }, instant(moment.stamp), placeWords(bundles, row), detail && detail.joined > 1 ? ` · judged with ${detail.joined - 1} before it` : ""));
  if (!detail) { made.append(...withoutDetail(run, row, moment)); return made; }
  const views = node("div", { class: "views" });
  detail.pictures.forEach((one) => { if (one.place !== null) views.append(pictureView(run, one)); });
  if (detail.objects || detail.points || detail.clusters.length) views.append(aroundView(detail));
  made.append(views);
  if (detail.conditions) made.append(conditionList(detail.conditions));
  if (detail.objects && detail.objects.length) made.append(objectTable(detail.objects));
  if (detail.places.length) made.append(placeTable(detail.places));
  made.append(node("h3", {}, "From sensors to objects"), node("ul", { class: "plain" }, ...detail.lines.map((line) => node("li", {}, line))));
  return made;
}

function placeWords(bundles, row) {
  const placed = bundles.placed[row];
  if (!placed) return "";
  const where = ` · x ${number(bundles.x[row], 2)} m, y ${number(bundles.y[row], 2)} m`;
  if (placed === "pose") return where + (bundles.heading_deg[row] === null ? "" : `, ${number(bundles.heading_deg[row], 1)}°`);
  return where + (placed === "truth" ? " (by the truth; it has no pose)" : " (between its neighbours; it has no pose)");
}

function withoutDetail(run, row, moment) {
  const near = moments.map((one, place) => [Math.abs(one.t - moment.t), place, one.rows[runs.indexOf(run)]])
    .filter(([, , other]) => other !== null && run.bundles.detail[other] !== null).sort((a, b) => a[0] - b[0])[0];
  const command = `mcap-landmarks explain RESULT --at ${moment.stamp} -o bundle.png`;
  const parts = [node("p", {}, "The page keeps no image, scan and match of this bundle. This draws it:"), node("pre", {}, command)];
  if (near) {
    const button = node("button", { type: "button" }, "Nearest bundle with its image");
    button.onclick = () => choose(near[1]);
    parts.push(button);
  }
  return parts;
}

function pictureView(run, picture) {
  const [width, height] = picture.size, boxes = picture.boxes || [];
  const names = boxes.map((box) => `${box[4]} ${box[5].toFixed(2)}`);
  const overlay = node("svg", { viewBox: `0 0 ${width} ${height}`, "aria-hidden": "true" });
  const size = Math.max(12, width / 32);
  const draw = (x1, y1, x2, y2, line, dash) => overlay.append(node("rect", { x: x1, y: y1, width: x2 - x1, height: y2 - y1, fill: "none", stroke: line, "stroke-width": Math.max(1.5, width / 280), "stroke-dasharray": dash }));
  boxes.forEach(([x1, y1, x2, y2], place) => {
    draw(x1, y1, x2, y2, "#facc15", null);
    overlay.append(node("text", { x: x1, y: y1 > size * 1.3 ? y1 - size * 0.3 : y1 + size, fill: "#fde047", stroke: "#111827", "stroke-width": size / 5, "paint-order": "stroke", "font-size": size, "font-family": "system-ui, sans-serif" }, names[place]));
  });
  picture.lost.forEach((box) => draw(...box, "#f87171", "8 5"));
  const image = node("img", { src: run.pictures[picture.place], alt: `Camera image${names.length ? " with " + names.join(", ") : picture.boxes ? " without a detection" : ""}`, width, height });
  const words = [picture.camera, picture.when, picture.boxes ? `${boxes.length} boxes` : "no detections"].filter(Boolean).join(" · ");
  return node("figure", {}, node("div", { class: "image" }, image, overlay), node("figcaption", {}, words));
}

function aroundView(detail) {
  // x ahead is up, y to the left is left.
  const objects = detail.objects || [], points = detail.points ? unpacked(detail.points) : [];
  const which = detail.point_clusters ? unpacked(detail.point_clusters) : null;
  const spots = [...objects.map((one) => [one.x_m, one.y_m]), ...detail.clusters, ...detail.landmarks.filter((one) => one[4])];
  const at = (x, y) => [-y, -x];
  if (!spots.length) for (let i = 0; i < points.length; i += 2) spots.push([points[i], points[i + 1]]);
  const ends = (axis) => { const all = [0, ...spots.map(([x, y]) => at(x, y)[axis])]; return [Math.min(...all), Math.max(...all)]; };
  const [[left, right], [top, bottom]] = [ends(0), ends(1)];
  const reach = Math.max(1.5, (right - left) / 2, (bottom - top) / 2) * 1.2, unit = reach / 100;
  const middle = [(left + right) / 2, (top + bottom) / 2], inside = (x, y) => Math.abs(x - middle[0]) < reach && Math.abs(y - middle[1]) < reach;
  const svg = node("svg", { class: "around", viewBox: `${middle[0] - reach} ${middle[1] - reach} ${2 * reach} ${2 * reach}`, role: "img", "aria-label": "From above, ahead is up" });
  const step = reach > 40 ? 20 : reach > 16 ? 10 : reach > 6 ? 5 : reach > 3 ? 2 : 1;
  for (let radius = step; radius < reach * 3; radius += step) {
    svg.append(node("circle", { cx: 0, cy: 0, r: radius, fill: "none", stroke: colour("line"), "stroke-width": unit * 0.5 }));
    const written = [[radius, 0], [-radius, 0], [0, radius], [0, -radius]].find(([x, y]) => inside(x * 1.02, y * 1.02) && spots.every((spot) => Math.hypot(at(...spot)[0] - x, at(...spot)[1] - y) > 14 * unit));
    if (written) svg.append(label(written[0], written[1] + 2.5 * unit, `${radius} m`, unit, colour("soft"), "middle"));
  }
  let dots = new Map();
  for (let i = 0; i < points.length; i += 2) {
    const [x, y] = at(points[i], points[i + 1]);
    if (!inside(x, y)) continue;
    const fill = which ? CLASS_COLOURS[Math.round(100 * which[i / 2]) % 8] : colour("soft");
    dots.set(fill, (dots.get(fill) || "") + `M${x.toFixed(2)} ${y.toFixed(2)}h0`);
  }
  for (const [fill, path] of dots) svg.append(node("path", { d: path, stroke: fill, "stroke-width": unit * 1.6, "stroke-linecap": "round", fill: "none" }));
  detail.clusters.forEach(([px, py, extent]) => {
    const [x, y] = at(px, py), r = Math.max(extent / 2, unit * 2.5);
    svg.append(node("rect", { x: x - r, y: y - r, width: 2 * r, height: 2 * r, fill: "none", stroke: colour("weak_geometry"), "stroke-width": unit * 0.7 }));
  });
  detail.landmarks.forEach(([px, py, id, name, matched]) => {
    const [x, y] = at(px, py), r = unit * 3;
    svg.append(node("path", { d: `M${x - r} ${y}H${x + r}M${x} ${y - r}V${y + r}`, stroke: matched ? colour("accent") : colour("truth"), "stroke-width": unit * (matched ? 1.2 : 0.7) }, node("title", {}, `landmark ${id}, ${name}`)));
  });
  objects.forEach((one, place) => {
    const [x, y] = at(one.x_m, one.y_m), region = detail.regions[place];
    if (one.landmark) svg.append(node("line", { x1: 0, y1: 0, x2: x, y2: y, stroke: colour("accent"), "stroke-width": unit * 0.5, opacity: 0.6 }));
    if (region) svg.append(node("ellipse", { cx: x, cy: y, rx: Math.max(region[0], unit), ry: Math.max(region[1], unit), transform: `rotate(${-90 - region[2]} ${x} ${y})`, fill: colour("candidate"), "fill-opacity": 0.18, stroke: colour("candidate"), "stroke-width": unit * 0.5 }));
    svg.append(node("circle", { cx: x, cy: y, r: unit * 1.5, fill: colour("candidate") }));
    const turned = x > middle[0] + reach * 0.4;
    svg.append(label(x + unit * (turned ? -3 : 3), y - unit * 2, one.class || "?", unit, colour("ink"), turned ? "end" : "start"));
  });
  svg.append(node("polygon", { points: `0,${-unit * 5} ${unit * 3.5},${unit * 4} ${-unit * 3.5},${unit * 4}`, fill: colour("ink") }));
  const legend = [points.length ? "dots: points" : "", detail.clusters.length ? "squares: clusters" : "", objects.length ? "discs: objects" : "", detail.landmarks.length ? "crosses: landmarks of the map" : ""].filter(Boolean).join(", ");
  return node("figure", {}, svg, node("figcaption", {}, `From above, ahead is up; ${legend}`));
}

function label(x, y, text, unit, fill, anchor) {
  return node("text", { x, y, fill, "font-size": unit * 7, "text-anchor": anchor, "font-family": "system-ui, sans-serif", stroke: colour("ground"), "stroke-width": unit * 1.4, "paint-order": "stroke" }, text);
}

function conditionList(conditions) {
  const items = conditions.map((one) => node("li", {}, node("span", { class: one.holds ? "holds" : "fails" }, one.holds ? "✓ holds " : "✗ FAILS "), `${one.name}: ${one.words}`));
  return node("div", {}, node("h3", {}, "Conditions of the decision"), node("ul", { class: "plain" }, ...items));
}

function table(head, rows, name) {
  const body = rows.map((row) => node("tr", {}, ...row.map((value) => node("td", { class: value.length > 8 && !/ m$|°$/.test(value) ? "long" : null }, value))));
  return node("div", { class: "wide", tabindex: "0", role: "region", "aria-label": name }, node("table", {}, node("thead", {}, node("tr", {}, ...head.map((value) => node("th", { scope: "col" }, value)))), node("tbody", {}, ...body)));
}

function objectTable(objects) {
  const rows = objects.map((one) => [`${one.class || "?"} ${one.probability.toFixed(2)}`, one.id || "–", `${one.range_m.toFixed(2)} m`, `${one.bearing_deg.toFixed(1)}°`, one.landmark || "–", one.residual_m === null ? "–" : metres(one.residual_m), number(one.sigmas, 1)]);
  return node("div", {}, node("h3", {}, "Objects and their landmarks"), table(["class", "object", "range", "bearing", "landmark", "off by", "sigmas"], rows, "Objects and their landmarks"));
}

function placeTable(places) {
  const rows = places.map((one) => [one.landmarks.join(" "), number(one.share, 4), one.pose ? `${number(one.pose.x_m, 2)} m, ${number(one.pose.y_m, 2)} m, ${number(one.pose.heading_deg, 1)}°` : "–", one.dof ? `${number(one.chi2, 1)} / ${one.dof}` : "–", one.sigma_m === null ? "–" : metres(one.sigma_m)]);
  return node("div", {}, node("h3", {}, places.length > 1 ? "Places that came into question" : "The place"), table(["landmarks", "share", "pose in the map", "chi2 / dof", "sigma"], rows, "Places"));
}

// ---- the strip over time

function drawStrip() {
  const strip = byId("strip"), canvas = strip.firstElementChild, ratio = devicePixelRatio || 1;
  const width = strip.clientWidth, height = 44, lane = height / runs.length;
  canvas.width = width * ratio; canvas.height = height * ratio;
  const pen = canvas.getContext("2d");
  pen.scale(ratio, ratio);
  pen.fillStyle = colour("grid"); pen.fillRect(0, 0, width, height);
  const colours = statuses.map((_, status) => colourOf(status)), mark = Math.max(1.2, width / moments.length - 0.6);
  runs.forEach((run, side) => moments.forEach((moment) => {
    const status = statusOf(moment, side);
    if (status === null) return;
    const tall = isFailure(status) ? lane - 3 : lane * 0.55;
    pen.fillStyle = colours[status];
    pen.fillRect(across(moment.t, width) - mark / 2, lane * (side + 1) - tall, mark, tall);
  }));
  const x = across(moments[chosen].t, width);
  pen.fillStyle = colour("ink"); pen.fillRect(x - 1, 0, 2, height);
  pen.beginPath(); pen.moveTo(x - 6, 0); pen.lineTo(x + 6, 0); pen.lineTo(x, 8); pen.fill();
}

function across(t, width) {
  const first = moments[0].t, span = moments[moments.length - 1].t - first || 1;
  return 7 + (t - first) / span * (width - 14);
}

function placeAt(x, width) {
  let best = 0;
  moments.forEach((moment, place) => { if (Math.abs(across(moment.t, width) - x) < Math.abs(across(moments[best].t, width) - x)) best = place; });
  return best;
}

// ---- plots

function layout(more) {
  const axis = { gridcolor: colour("grid"), zerolinecolor: colour("line"), linecolor: colour("line"), tickcolor: colour("line"), automargin: true };
  const made = { paper_bgcolor: "rgba(0,0,0,0)", plot_bgcolor: "rgba(0,0,0,0)", font: { color: colour("ink"), size: 12, family: "system-ui, sans-serif" }, margin: { l: 50, r: 10, t: 30, b: 40 }, hovermode: "closest", modebar: { bgcolor: "rgba(0,0,0,0)", color: colour("soft"), activecolor: colour("ink") }, hoverlabel: { bgcolor: colour("card"), bordercolor: colour("line"), font: { color: colour("ink") } }, legend: { orientation: "h", y: -0.12, font: { size: 11 } }, ...more };
  for (const [key, value] of Object.entries(made)) if (/^[xy]axis/.test(key)) made[key] = { ...axis, ...value };
  return made;
}

// Only what works without any network: the library has buttons that send a plot elsewhere.
const CONFIG = { displaylogo: false, responsive: true, modeBarButtons: [["toImage", "zoom2d", "pan2d", "zoomIn2d", "zoomOut2d", "resetScale2d"]] };

function line(name, [x, y], shade, dash, width) {
  return { name, x, y, mode: "lines", type: "scatter", hoverinfo: "skip", line: { color: shade, dash, width } };
}

function regionTrace(name, regions, shade) {
  const x = [], y = [];
  regions.forEach(([cx, cy, a, b, degrees]) => {
    const turn = degrees * Math.PI / 180;
    for (let i = 0; i <= 24; i++) {
      const angle = i * Math.PI / 12, u = a * Math.cos(angle), v = b * Math.sin(angle);
      x.push(cx + u * Math.cos(turn) - v * Math.sin(turn)); y.push(cy + u * Math.sin(turn) + v * Math.cos(turn));
    }
    x.push(null); y.push(null);
  });
  return { name, x, y, mode: "lines", type: "scatter", fill: "toself", hoverinfo: "skip", line: { color: shade, width: 1 }, fillcolor: shade + "26" };
}

function mapTraces() {
  const traces = [], two = runs.length > 1, shades = two ? [colour("accent"), colour("candidate")] : [colour("ink")];
  const withTruth = runs.find((run) => run.paths.truth), withOdometry = runs.find((run) => run.paths.odometry);
  if (withOdometry) traces.push(line("odometry", withOdometry.paths.odometry, colour("odometry"), "dash", 1.2));
  if (withTruth) traces.push(line("truth", withTruth.paths.truth, colour("truth"), "solid", 4));
  runs.forEach((run, side) => {
    const before = two ? `${data.sides[side]}: ` : "";
    if (run.regions.length) traces.push({ ...regionTrace(`${before}95 % regions`, run.regions, shades[side]), visible: two ? "legendonly" : true });
    if (run.paths.estimate) traces.push(line(`${before}estimate`, run.paths.estimate, shades[side], two && side === 0 ? "dot" : "solid", two ? 2 : 1.2));
    if (!two) traces.push(errorTrace(run));
    statuses.forEach((status, number) => traces.push(...bundleTrace(run, side, number, before)));
  });
  const places = (run) => JSON.stringify(run.landmarks.map((one) => [one.class, one.at]));
  const maps = runs.filter((run) => run.landmarks.length), same = maps.length === 2 && places(maps[0]) === places(maps[1]);
  (same ? maps.slice(0, 1) : maps).forEach((run) => traces.push(...landmarkTraces(run, maps.length === 2 && !same)));
  const known = runs.find((run) => run.objects.length);
  if (known) traces.push({ name: "true objects", type: "scatter", mode: "markers", x: known.objects.map((one) => one[0]), y: known.objects.map((one) => one[1]), text: known.objects.map((one) => plain(`true ${one[2]}`)), hoverinfo: "text", marker: { symbol: "circle-open", size: 17, color: colour("truth") } });
  traces.push({ name: "chosen", type: "scatter", mode: "lines+markers", x: [], y: [], hoverinfo: "skip", showlegend: false, line: { color: colour("accent"), width: 1.5 }, marker: { symbol: "circle-open", size: [], color: colour("accent"), line: { width: 3 } } });
  return traces.filter((trace) => trace.name === "chosen" || trace.x.length);
}

function errorTrace(run) {
  const x = [], y = [], bundles = run.bundles;
  bundles.truth_x.forEach((value, row) => { if (value !== null) { x.push(value, bundles.x[row], null); y.push(bundles.truth_y[row], bundles.y[row], null); } });
  return { ...line("errors", [x, y], colour("no_match"), "solid", 1.2) };
}

function bundleTrace(run, side, status, before) {
  const rows = run.bundles.status.map((one, row) => one === status && run.bundles.x[row] !== null ? row : -1).filter((row) => row >= 0);
  if (!rows.length) return [];
  const bundles = run.bundles, open = runs.length > 1 && side === 0 && !SYMBOLS[status].endsWith("-open") ? "-open" : "";
  const text = rows.map((row) => plain(`${before}${bundles.t[row].toFixed(2)} s, ${statuses[status].words}${bundles.off_m[row] === null ? "" : ", off by " + metres(bundles.off_m[row])}`));
  return [{ name: plain(`${before}${statuses[status].words} (${run.counts[status]})`), type: "scatter", mode: "markers", x: rows.map((row) => bundles.x[row]), y: rows.map((row) => bundles.y[row]), customdata: rows.map((row) => momentAt.get(bundles.stamp[row])), text, hoverinfo: "text", marker: { symbol: SYMBOLS[status] + open, size: isFailure(status) ? 10 : 6, color: colourOf(status), line: { width: isFailure(status) ? 1 : 0, color: colour("card") } } }];
}

function landmarkTraces(run, named) {
  const before = named ? `${data.sides[runs.indexOf(run)]}: ` : "", open = named && run === runs[0] ? "-open" : "";
  const regions = run.landmarks.filter((one) => one.region).map((one) => one.region);
  const traces = regions.length ? [{ ...regionTrace(`${before}landmarks' 95 % regions`, regions, colour("region")) }] : [];
  const counts = new Map();
  run.landmarks.forEach((one) => counts.set(one.class, (counts.get(one.class) || 0) + 1));
  const names = [...counts.keys()].sort((a, b) => counts.get(b) - counts.get(a) || (a < b ? -1 : 1));
  const groups = names.length > 8 ? [["landmark", run.landmarks]] : names.map((name) => [name, run.landmarks.filter((one) => one.class === name)]);
  groups.forEach(([name, members], place) => traces.push({ name: plain(before + (name || "landmark without class")), type: "scatter", mode: "markers", x: members.map((one) => one.at[0]), y: members.map((one) => one.at[1]), text: members.map((one) => plain(`${one.class}, landmark ${one.id}${run.bundles.stamp.length ? ", matched " + one.matched + " times" : ""}`)), hoverinfo: "text", marker: { symbol: CLASS_SYMBOLS[place] + open, size: 11, color: CLASS_COLOURS[place], line: { width: 1, color: colour("card") } } }));
  return traces;
}

function drawMap() {
  const place = byId("map");
  if (!place) return;
  const narrow = matchMedia("(max-width: 900px)").matches, phone = matchMedia("(max-width: 560px)").matches;
  const shape = layout({ dragmode: "pan", xaxis: { ticksuffix: " m" }, yaxis: { ticksuffix: " m", scaleanchor: "x" }, legend: { orientation: "h", y: -0.07, font: { size: 11 } }, margin: { l: 44, r: 8, t: 34, b: 30 }, uirevision: "map", showlegend: !phone });
  Plotly.react(place, mapTraces(), shape, { ...CONFIG, scrollZoom: !narrow, displayModeBar: true }).then(() => {
    if (place.dataset.heeded) return;
    place.dataset.heeded = "yes";
    place.on("plotly_click", (event) => { const hit = event.points.find((one) => one.customdata !== undefined); if (hit) choose(hit.customdata); });
    markChosen();
  });
}

function markChosen() {
  const place = byId("map");
  if (!place || !place.data || !moments.length) return;
  const moment = moments[chosen], x = [], y = [], size = [];
  runs.forEach((run, side) => {
    const row = moment.rows[side];
    if (row === null || run.bundles.x[row] === null) return;
    const at = [run.bundles.x[row], run.bundles.y[row]], detail = run.details[run.bundles.detail[row]];
    const names = new Set(detail && detail.objects ? detail.objects.map((one) => one.landmark).filter(Boolean) : []);
    x.push(at[0]); y.push(at[1]); size.push(16);
    run.landmarks.filter((one) => names.has(one.id)).forEach((one) => { x.push(one.at[0], at[0]); y.push(one.at[1], at[1]); size.push(0, 0); });
    x.push(null); y.push(null); size.push(0);
  });
  Plotly.restyle(place, { x: [x], y: [y], "marker.size": [size] }, [place.data.length - 1]);
}

function drawErrors() {
  const curves = byId("errors"), boxes = byId("boxes");
  if (!curves) return;
  const shades = runs.length > 1 ? [colour("accent"), colour("candidate")] : [colour("accent")], traces = [], plots = [];
  runs.forEach((run, side) => {
    if (!run.errors.t) return;
    const before = runs.length > 1 ? `${data.sides[side]}: ` : "", errors = run.errors;
    [["x", colour("accent"), "y"], ["y", colour("candidate"), "y"], ["heading", colour("inconsistent"), "y2"]].forEach(([name, shade, axis]) => traces.push({ name: `${before}${name}`, type: "scatter", mode: errors.t.length > 400 ? "lines" : "lines+markers", x: errors.t, y: errors[name], yaxis: axis, line: { width: 1.2, color: shade, dash: side === 0 && runs.length > 1 ? "dot" : "solid" }, marker: { size: 4 } }));
    errors.boxes.forEach((box, place) => {
      if (!box) return;
      const tag = { xaxis: place === 2 ? "x2" : "x", yaxis: place === 2 ? "y2" : "y" }, name = ["x", "y", "heading"][place];
      plots.push({ type: "box", orientation: "h", name: `${before}${name}`, y: [`${before}${name}`], q1: [box.quartiles[0]], median: [box.quartiles[1]], q3: [box.quartiles[2]], lowerfence: [box.whiskers[0]], upperfence: [box.whiskers[1]], marker: { color: shades[side] }, fillcolor: shades[side] + "33", showlegend: false, ...tag });
      if (box.outliers.length) plots.push({ type: "scatter", mode: "markers", x: box.outliers, y: box.outliers.map(() => `${before}${name}`), hoverinfo: "x", marker: { symbol: "circle-open", size: 5, color: shades[side] }, showlegend: false, ...tag });
    });
  });
  Plotly.react(curves, traces, layout({ title: { text: "over time", font: { size: 13 } }, xaxis: { ticksuffix: " s", anchor: "y2" }, yaxis: { ticksuffix: " m", domain: [0.44, 1] }, yaxis2: { ticksuffix: "°", domain: [0, 0.36] }, legend: { orientation: "h", y: -0.16 } }), CONFIG).then(() => {
    if (curves.dataset.heeded) return;
    curves.dataset.heeded = "yes";
    curves.on("plotly_click", (event) => choose(nearestTo(event.points[0].x)));
  });
  Plotly.react(boxes, plots, layout({ title: { text: "box plots", font: { size: 13 } }, xaxis: { ticksuffix: " m", anchor: "y", nticks: 6 }, yaxis: { domain: [0.42, 1], autorange: "reversed" }, xaxis2: { ticksuffix: "°", anchor: "y2", nticks: 6 }, yaxis2: { domain: [0, 0.24], autorange: "reversed" }, margin: { l: 60, r: 10, t: 30, b: 40 } }), CONFIG);
}

function nearestTo(t) {
  return moments.reduce((best, moment, place) => Math.abs(moment.t - t) < Math.abs(moments[best].t - t) ? place : best, 0);
}

function drawConfidences() {
  const place = byId("confidences");
  if (!place) return;
  const shown = runs[0].detector.slice(0, 8), middle = Array.from({ length: 20 }, (_, i) => (i + 0.5) / 20);
  const traces = shown.map((one, number) => ({ name: plain(one.name), type: "bar", x: middle, y: one.histogram, width: 0.048, marker: { color: CLASS_COLOURS[number] }, hovertemplate: `${plain(one.name)}: %{y}<extra></extra>` }));
  Plotly.react(place, traces, layout({ barmode: "stack", title: { text: "confidences of the boxes", font: { size: 13 } }, xaxis: { range: [0, 1] }, yaxis: { title: { text: "boxes" } } }), CONFIG);
}

// ---- what the page heeds

function drawLegend() {
  const legend = byId("legend"), buttons = [];
  statuses.forEach((status, number) => {
    const counts = runs.map((run) => run.counts[number]);
    if (!counts.some(Boolean)) return;
    const button = node("button", { type: "button", "data-status": status.name }, node("span", { class: "glyph", "aria-hidden": "true" }, GLYPHS[number]), ` ${status.words} ${counts.join(" → ")}`);
    button.title = status.hint;
    button.firstChild.style.color = colourOf(number);
    button.onclick = () => chooseNext((moment) => runs.some((_, side) => statusOf(moment, side) === number));
    buttons.push(button);
  });
  legend.replaceChildren(...buttons);
}

function heedKeys(place) {
  place.addEventListener("keydown", (event) => {
    const steps = { ArrowRight: 1, ArrowUp: 1, ArrowLeft: -1, ArrowDown: -1, PageUp: 25, PageDown: -25, Home: -moments.length, End: moments.length };
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    if (event.key in steps) choose(chosen + steps[event.key]);
    else if (event.key === "Enter") choose(chosen, true);
    else if (event.key === "n") chooseNext(isOfNote);
    else return;
    event.preventDefault();
  });
}

function heedDrive() {
  if (!byId("strip") || !moments.length) {
    for (const id of ["strip", "before", "after", "failure"]) if (byId(id)) byId(id).hidden = true;
    return;
  }
  heedKeys(byId("strip")); heedKeys(byId("map"));
  byId("strip").addEventListener("click", (event) => choose(placeAt(event.offsetX, byId("strip").clientWidth)));
  byId("before").onclick = () => choose(chosen - 1);
  byId("after").onclick = () => choose(chosen + 1);
  byId("failure").onclick = () => chooseNext(isOfNote);
  byId("failure").disabled = !moments.some(isOfNote);
  new ResizeObserver(drawStrip).observe(byId("strip"));
  for (const row of document.querySelectorAll("tr[data-stamp]")) {
    const button = row.querySelector("button");
    if (button) button.onclick = () => { if (momentAt.has(row.dataset.stamp)) choose(momentAt.get(row.dataset.stamp), true); };
  }
}

function heedSorting() {
  for (const head of document.querySelectorAll("th[data-sort]")) head.querySelector("button").onclick = () => {
    const rising = head.getAttribute("aria-sort") !== "ascending", body = head.closest("table").tBodies[0], column = head.cellIndex;
    for (const other of head.parentNode.children) other.removeAttribute("aria-sort");
    head.setAttribute("aria-sort", rising ? "ascending" : "descending");
    const value = (row) => row.cells[column].dataset.value;
    const order = (a, b) => {
      if (value(a) === "" || value(b) === "") return (value(a) === "") - (value(b) === "");
      const apart = head.dataset.sort === "number" ? Number(value(a)) - Number(value(b)) : value(a).localeCompare(value(b));
      return rising ? apart : -apart;
    };
    body.append(...[...body.rows].sort(order));
  };
}

// A link of the table opens the section that it goes to.
function heedLinks() {
  for (const link of document.querySelectorAll("#logs a")) link.addEventListener("click", () => { byId(link.getAttribute("href").slice(1)).open = true; });
}

function setTheme(dark) {
  document.documentElement.dataset.theme = dark ? "dark" : "light";
  byId("theme").textContent = dark ? "Light" : "Dark";
  byId("theme").setAttribute("aria-pressed", String(dark));
}

function drawAll() {
  if (!runs.length) return;
  if (byId("legend")) drawLegend();
  drawMap(); drawErrors(); drawConfidences();
  if (moments.length && byId("strip")) choose(chosen);
}

const prefersDark = matchMedia("(prefers-color-scheme: dark)");
setTheme(prefersDark.matches);
prefersDark.addEventListener("change", (event) => { setTheme(event.matches); drawAll(); });
byId("theme").onclick = () => { setTheme(document.documentElement.dataset.theme !== "dark"); drawAll(); };
heedSorting();
heedLinks();
heedDrive();
if (data.first && momentAt.has(data.first)) chosen = momentAt.get(data.first);
drawAll();
