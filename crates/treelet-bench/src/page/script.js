// Niceties only: the page is whole without them. Reads values off curves, and narrows what is shown.
"use strict";
(() => {
  const superscript = n => String(n).replace(/\d/g, d => "⁰¹²³⁴⁵⁶⁷⁸⁹"[d]);
  const rays = n => {
    const power = Math.floor(Math.log10(n) + 1e-9);
    return (n / 10 ** power).toFixed(1) + " × 10" + superscript(power) + " rays";
  };
  const short = x => x >= 99.95 ? x.toFixed(0) : x >= 9.995 ? x.toFixed(1) : x >= 0.0995 ? x.toFixed(2) : x.toPrecision(2);

  // The height of a curve at some place, from its own path.
  const points = path => path.getAttribute("d").slice(1).split("L").map(p => p.split(" ").map(Number));
  const height = (curve, x) => {
    let i = curve.findIndex(p => p[0] >= x);
    if (i < 0) return null;
    if (i === 0) i = 1;
    const [a, b] = [curve[i - 1], curve[i]];
    return a[1] + (b[1] - a[1]) * (x - a[0]) / (b[0] - a[0]);
  };

  for (const svg of document.querySelectorAll("svg.chart")) {
    const [left, right, top, bottom, most] = svg.dataset.frame.split(" ").map(Number);
    const [from, to] = svg.dataset.rays.split(" ").map(Number);
    let curves = null;
    const make = (name, attributes, text) => {
      const node = document.createElementNS(svg.namespaceURI, name);
      for (const key in attributes) node.setAttribute(key, attributes[key]);
      if (text) node.textContent = text;
      return node;
    };
    let readout = null;
    const clear = () => { if (readout) readout.remove(); readout = null; };
    svg.addEventListener("pointerleave", clear);
    svg.addEventListener("pointermove", event => {
      const place = new DOMPoint(event.clientX, event.clientY).matrixTransform(svg.getScreenCTM().inverse());
      clear();
      if (place.x < left || place.x > right || place.y < top - 10 || place.y > bottom) return;
      curves ??= [...svg.querySelectorAll("path.curve")].map(p => ({ name: p.dataset.name, look: p.classList[1], at: points(p) }));
      const best = curves.map(c => ({ ...c, y: height(c.at, place.x) })).filter(c => c.y !== null)
        .sort((a, b) => a.y - b.y).slice(0, 7);
      const n = from * 10 ** (Math.log10(to / from) * (place.x - left) / (right - left));
      readout = make("g", { class: "readout", "aria-hidden": "true" });
      readout.append(make("line", { x1: place.x, x2: place.x, y1: top, y2: bottom }));
      const widest = Math.max(19, ...best.map(c => c.name.length + 8));
      const width = 7 * widest + 16, x = place.x + 14 + width > right ? place.x - width - 14 : place.x + 14;
      const y = Math.min(Math.max(place.y - 40, top), bottom - 30 - 17 * best.length);
      readout.append(make("rect", { x, y, width, height: 26 + 17 * best.length, rx: 4 }));
      readout.append(make("text", { x: x + 10, y: y + 18, class: "head" }, rays(n)));
      best.forEach((c, i) => {
        const row = y + 36 + 17 * i;
        readout.append(make("circle", { cx: x + 14, cy: row - 4, r: 4, class: "spot " + c.look }));
        readout.append(make("text", { x: x + 24, y: row }, c.name));
        readout.append(make("text", { x: x + width - 10, y: row, "text-anchor": "end" },
          short((bottom - c.y) / (bottom - top) * most)));
        readout.append(make("circle", { cx: place.x, cy: c.y, r: 3, class: "spot " + c.look }));
      });
      svg.append(readout);
    });
  }

  // One list for each thing that can be chosen; nothing is hidden on a page without this script.
  const bar = document.createElement("form");
  bar.className = "chooser";
  bar.setAttribute("aria-label", "What to show");
  const wanted = {};
  const show = () => {
    for (const key in wanted) {
      for (const node of document.querySelectorAll(`[data-${key}]`)) {
        node.hidden = wanted[key] !== "" && node.dataset[key] !== wanted[key];
      }
    }
  };
  const names = { speed: "rays a second", share: "share of tracing speed" };
  for (const [key, label, all] of [["scene", "Scene", "all"], ["kind", "Rays", "all kinds"], ["form", "Axis", "both"]]) {
    const values = [...new Set([...document.querySelectorAll(`[data-${key}]`)].map(node => node.dataset[key]))];
    if (values.length < 2) continue;
    const select = document.createElement("select");
    for (const value of ["", ...values]) {
      const option = document.createElement("option");
      option.value = value;
      option.textContent = value === "" ? all : names[value] ?? value;
      select.append(option);
    }
    wanted[key] = key === "form" ? "speed" : "";
    select.value = wanted[key];
    select.addEventListener("change", () => { wanted[key] = select.value; show(); });
    const holder = document.createElement("label");
    holder.append(label + " ", select);
    bar.append(holder);
  }
  if (bar.children.length) {
    document.querySelector("main").before(bar);
    show();
  }
})();
