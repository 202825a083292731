// Reading values, hiding curves, zooming, saving. The page is complete without it.
"use strict";
(() => {
  const NS = "http://www.w3.org/2000/svg";
  const make = (parent, tag, attributes) => {
    const element = document.createElementNS(NS, tag);
    for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
    return parent.appendChild(element);
  };
  const box = (plot) => ["x", "y", "width", "height"].map((a) => Number(plot.getAttribute(a)));

  // An axis of a plot, as it stands in data-x or data-y: from values to pixels of the unzoomed drawing and back.
  const axis = (text, from, to) => {
    const [kind, low, high] = text.split(" ");
    const along = kind === "log" ? Math.log10 : (v) => v;
    const [a, b] = [along(Number(low)), along(Number(high))];
    return {
      isLog: kind === "log",
      pixel: (value) => from + ((along(value) - a) / (b - a)) * (to - from),
      value: (pixel) => {
        const v = a + ((pixel - from) / (to - from)) * (b - a);
        return kind === "log" ? 10 ** v : v;
      },
    };
  };
  const axes = (plot) => {
    const [x, y, w, h] = box(plot);
    return { x: axis(plot.dataset.x, x, x + w), y: axis(plot.dataset.y, y + h, y) };
  };
  const view = (plot) => plot.getAttribute("viewBox").split(" ").map(Number);

  const readable = (v) => {
    if (v === 0) return "0";
    const size = Math.abs(v);
    return size >= 1e5 || size < 1e-3 ? v.toExponential(2) : String(Number(v.toPrecision(4)));
  };

  // The points of a path in pixels of the unzoomed drawing.
  const known = new WeakMap();
  const points = (path) => {
    if (!known.has(path)) {
      const list = [];
      for (const m of path.getAttribute("d").matchAll(/[ML](-?[\d.]+) (-?[\d.]+)/g)) list.push([Number(m[1]), Number(m[2])]);
      known.set(path, list);
    }
    return known.get(path);
  };
  const nearest = (list, x) => list.reduce((best, p) => (Math.abs(p[0] - x) < Math.abs(best[0] - x) ? p : best), list[0]);

  // From a mouse event to pixels of the drawing, and of the unzoomed one.
  const place = (svg, plot, event) => {
    const p = new DOMPoint(event.clientX, event.clientY).matrixTransform(svg.getScreenCTM().inverse());
    const [[x, y, w, h], [vx, vy, vw, vh]] = [box(plot), view(plot)];
    return { here: [p.x, p.y], there: [vx + ((p.x - x) / w) * vw, vy + ((p.y - y) / h) * vh] };
  };
  const plotAt = (svg, event) =>
    [...svg.querySelectorAll("svg.plot")].find((plot) => {
      const [x, y, w, h] = box(plot);
      const p = new DOMPoint(event.clientX, event.clientY).matrixTransform(svg.getScreenCTM().inverse());
      return p.x >= x && p.x <= x + w && p.y >= y && p.y <= y + h;
    });
  const visible = (svg) => svg.getClientRects().length > 0;
  const group = (svg) =>
    svg.dataset.group && svg.dataset.group !== "map"
      ? [...document.querySelectorAll(`svg.chart[data-group="${svg.dataset.group}"]`)]
      : [svg];

  // Values of all curves of a chart where the mouse is, and a line there.
  const read = (svg, value, isUnderMouse, event) => {
    clear(svg);
    const lines = [];
    for (const plot of svg.querySelectorAll("svg.plot")) {
      const { x, y } = axes(plot);
      const [vx, , vw] = view(plot);
      const [left, top, width, height] = box(plot);
      const pixel = x.pixel(value);
      if (!(pixel >= vx && pixel <= vx + vw)) continue;
      const at = left + ((pixel - vx) / vw) * width;
      make(svg, "path", { class: "cross", d: `M${at} ${top}V${top + height}` });
      // the last drawn first; curves of one name, such as recordings, in one line
      const found = new Map();
      for (const series of [...plot.querySelectorAll(".series:not(.off)")].reverse()) {
        const path = series.querySelector(".line:not(.level), .dot");
        if (!path || !series.dataset.name || !points(path).length) continue;
        const p = nearest(points(path), pixel);
        if (Math.abs(p[0] - pixel) >= 0.02 * width) continue;
        const own = found.get(series.dataset.name) ?? { series, path, values: [] };
        own.values.push(y.value(p[1]));
        found.set(series.dataset.name, own);
      }
      const isFirst = plot === svg.querySelector("svg.plot");
      for (const [name, { series, path, values }] of found) {
        const ends = new Set([Math.min(...values), Math.max(...values)].map(readable));
        const rank = series.classList.contains("soft") ? 2 : path.classList.contains("dashed") ? 1 : 0;
        lines.push([series, `${name}${isFirst ? "" : ` (${plot.dataset.name})`}: ${[...ends].join(" … ")}`, rank]);
      }
    }
    if (!isUnderMouse || !lines.length) return;
    lines.sort((a, b) => a[2] - b[2]);
    const figure = svg.closest("figure");
    const note = figure.appendChild(document.createElement("div"));
    note.className = "reading";
    note.append(readable(value));
    for (const [series, text] of lines.slice(0, 14)) {
      const line = note.appendChild(document.createElement("div"));
      const name = line.appendChild(document.createElement("b"));
      name.className = [...series.classList].find((c) => c !== "series");
      name.textContent = "— ";
      line.append(text);
    }
    const frame = figure.getBoundingClientRect();
    const left = event.clientX - frame.left;
    note.style.top = `${event.clientY - frame.top + 14}px`;
    note.style.left = `${left + note.offsetWidth + 20 > frame.width ? Math.max(0, left - note.offsetWidth - 12) : left + 14}px`;
  };
  const clear = (svg) => {
    svg.querySelectorAll(".cross").forEach((e) => e.remove());
    svg.closest("figure")?.querySelectorAll(".reading").forEach((e) => e.remove());
  };

  // Round values between two, as in the drawing.
  const ticks = (ruler, low, high, most) => {
    if (ruler.isLog && high / low >= 6) {
      const list = [];
      const factors = high / low < 40 ? [1, 2, 5] : [1];
      const every = Math.max(1, Math.ceil(Math.log10(high / low) / most));
      for (let e = Math.floor(Math.log10(low)); e <= Math.ceil(Math.log10(high)); e++)
        if (e % every === 0) factors.forEach((f) => list.push(f * 10 ** e));
      return list.filter((v) => v >= low && v <= high);
    }
    const raw = (high - low) / most;
    const power = 10 ** Math.floor(Math.log10(raw));
    const step = [1, 2, 5, 10].map((m) => m * power).find((s) => s >= raw * 0.999) ?? raw;
    const list = [];
    for (let k = Math.ceil(low / step); k * step <= high; k++) list.push(k * step);
    return list;
  };
  const label = (v) => readable(Number(v.toPrecision(6))).replace("-", "−");

  // Draws the ticks of a plot anew, for what is in view.
  const retick = (svg, plot) => {
    const old = plot.previousElementSibling;
    old._whole ??= old.innerHTML;
    const [x, y, w, h] = box(plot);
    const [vx, vy, vw, vh] = view(plot);
    const isWhole = plot.getAttribute("viewBox") === plot.dataset.whole;
    svg.querySelectorAll(".place").forEach((e) => (e.style.display = isWhole ? "" : "none"));
    if (isWhole) return void (old.innerHTML = old._whole);
    const rulers = axes(plot);
    old.innerHTML = "";
    const font = parseFloat(getComputedStyle(svg).fontSize);
    for (const v of ticks(rulers.y, rulers.y.value(vy + vh), rulers.y.value(vy), Math.ceil(h / 42))) {
      const at = y + ((rulers.y.pixel(v) - vy) / vh) * h;
      make(old, "path", { class: "grid", d: `M${x} ${at}H${x + w}` });
      make(old, "text", { class: "tick", x: x - 6, y: at + 0.35 * font, "text-anchor": "end" }).textContent = label(v);
    }
    const isLast = plot === [...svg.querySelectorAll("svg.plot")].pop();
    for (const v of ticks(rulers.x, rulers.x.value(vx), rulers.x.value(vx + vw), w > 500 ? 9 : 4)) {
      const at = x + ((rulers.x.pixel(v) - vx) / vw) * w;
      make(old, "path", { class: "grid", d: `M${at} ${y + h}V${y}` });
      if (isLast)
        make(old, "text", { class: "tick", x: at, y: y + h + font + 5, "text-anchor": "middle" }).textContent = label(v);
    }
    if (isLast) {
      const name = [...new DOMParser().parseFromString(`<svg xmlns="${NS}">${old._whole}</svg>`, "image/svg+xml").querySelectorAll(".name")].pop();
      if (name) old.append(document.importNode(name, true));
    }
  };
  const zoom = (svg, plot, area) => {
    const { x } = axes(plot);
    const ends = [x.value(area[0]), x.value(area[0] + area[2])];
    plot.setAttribute("viewBox", area.join(" "));
    for (const other of group(svg)) {
      for (const peer of other.querySelectorAll("svg.plot")) {
        if (peer !== plot) {
          const ruler = axes(peer).x;
          const v = view(peer);
          const [a, b] = ends.map(ruler.pixel);
          peer.setAttribute("viewBox", [a, v[1], b - a, v[3]].join(" "));
        }
        retick(other, peer);
      }
    }
  };
  const reset = (svg) => {
    for (const other of group(svg))
      for (const plot of other.querySelectorAll("svg.plot")) {
        plot.setAttribute("viewBox", plot.dataset.whole);
        retick(other, plot);
      }
  };

  // The drawing as a file.
  const save = (svg, kind, title) => {
    const copy = svg.cloneNode(true);
    const [, , width, height] = svg.getAttribute("viewBox").split(" ");
    copy.setAttribute("xmlns", NS);
    copy.setAttribute("width", width);
    copy.setAttribute("height", height);
    const style = document.createElementNS(NS, "style");
    style.textContent = document.querySelector("style").textContent;
    const paper = document.createElementNS(NS, "rect");
    for (const [name, value] of [["class", "paper"], ["width", width], ["height", height]]) paper.setAttribute(name, value);
    copy.prepend(style, paper);
    copy.querySelectorAll(".cross, .frame").forEach((e) => e.remove());
    copy.style.display = "block";
    const blob = new Blob([new XMLSerializer().serializeToString(copy)], { type: "image/svg+xml" });
    const give = (content) => {
      const link = document.createElement("a");
      link.href = URL.createObjectURL(content);
      link.download = `${title.replace(/[^\w]+/g, "_")}.${kind}`;
      link.click();
      setTimeout(() => URL.revokeObjectURL(link.href), 1000);
    };
    if (kind === "svg") return give(blob);
    const image = new Image();
    image.onload = () => {
      const canvas = document.createElement("canvas");
      [canvas.width, canvas.height] = [2 * width, 2 * height];
      canvas.getContext("2d").drawImage(image, 0, 0, canvas.width, canvas.height);
      canvas.toBlob(give);
    };
    image.src = URL.createObjectURL(blob);
  };

  for (const plot of document.querySelectorAll("svg.plot")) plot.dataset.whole = plot.getAttribute("viewBox");
  for (const svg of document.querySelectorAll("svg.chart")) {
    for (const key of svg.querySelectorAll(".key")) {
      const toggle = () => {
        const isOff = key.classList.toggle("off");
        key.setAttribute("aria-pressed", String(!isOff));
        svg.querySelectorAll(`.series[data-k="${key.dataset.k}"]`).forEach((s) => s.classList.toggle("off", isOff));
      };
      for (const [name, value] of [["role", "button"], ["tabindex", "0"], ["aria-pressed", "true"]]) key.setAttribute(name, value);
      key.addEventListener("click", toggle);
      key.addEventListener("keydown", (e) => (e.key === "Enter" || e.key === " ") && (e.preventDefault(), toggle()));
    }
    let start = null;
    svg.addEventListener("pointerdown", (event) => {
      const plot = event.pointerType === "mouse" && event.button === 0 && plotAt(svg, event);
      if (plot) start = { plot, ...place(svg, plot, event) };
    });
    svg.addEventListener("pointermove", (event) => {
      const plot = plotAt(svg, event);
      group(svg).forEach(clear);
      svg.querySelectorAll(".frame").forEach((e) => e.remove());
      if (start) {
        const { here } = place(svg, start.plot, event);
        const [a, b] = [start.here, here];
        make(svg, "rect", { class: "frame", x: Math.min(a[0], b[0]), y: Math.min(a[1], b[1]), width: Math.abs(a[0] - b[0]), height: Math.abs(a[1] - b[1]) });
      } else if (plot && svg.dataset.group !== "map") {
        const value = axes(plot).x.value(place(svg, plot, event).there[0]);
        group(svg).filter(visible).forEach((other) => read(other, value, other === svg, event));
      }
    });
    svg.addEventListener("pointerleave", () => group(svg).forEach(clear));
    window.addEventListener("pointerup", (event) => {
      if (!start) return;
      svg.querySelectorAll(".frame").forEach((e) => e.remove());
      const { plot, there, here } = start;
      const end = place(svg, plot, event);
      start = null;
      if (Math.abs(end.here[0] - here[0]) < 6 || Math.abs(end.here[1] - here[1]) < 6) return;
      const area = [0, 1].map((i) => Math.min(there[i], end.there[i]));
      const size = [0, 1].map((i) => Math.abs(there[i] - end.there[i]));
      if (svg.dataset.group === "map") {
        const [, , w, h] = box(plot);
        const scale = Math.max(size[0] / w, size[1] / h);
        [w, h].forEach((whole, i) => {
          area[i] += 0.5 * (size[i] - scale * whole);
          size[i] = scale * whole;
        });
      }
      zoom(svg, plot, [...area, ...size]);
    });
    svg.addEventListener("dblclick", () => reset(svg));
  }
  for (const figure of document.querySelectorAll("figure:has(svg.chart)")) {
    const tools = figure.appendChild(document.createElement("div"));
    tools.className = "tools";
    for (const kind of ["svg", "png"]) {
      const button = tools.appendChild(document.createElement("button"));
      button.textContent = kind.toUpperCase();
      button.title = `Save the figure as ${kind.toUpperCase()}. Drag to zoom, double-click to see all.`;
      button.addEventListener("click", () => save([...figure.querySelectorAll("svg.chart")].find(visible), kind, figure.querySelector("h3").textContent));
    }
  }
})();
