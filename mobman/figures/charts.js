"use strict";
(() => {
  const configs = CONFIGS;
  const dark = matchMedia("(prefers-color-scheme: dark)");
  const shown = new Map();

  async function draw(place) {
    const spec = JSON.parse(place.querySelector("script").textContent);
    const width = place.clientWidth;
    const config = structuredClone(configs[dark.matches ? "dark" : "light"]);
    config.legend.columns = Math.max(1, Math.floor(width / 170));
    config.axis.labelLimit = Math.max(90, 0.3 * width);
    shown.get(place)?.finalize();
    let canvas = place.querySelector(".vega");
    if (!canvas) {
      canvas = document.createElement("div");
      canvas.className = "vega";
      canvas.style.width = "100%";
      place.append(canvas);
    }
    const actions = { export: true, source: false, compiled: false, editor: false };
    shown.set(place, await vegaEmbed(canvas, spec, { config, actions, renderer: "canvas", logLevel: 1 }));
    place.dataset.drawn = Math.round(width);
  }

  // drawn when they come into sight: a report has hundreds
  const watch = new IntersectionObserver((found) => {
    for (const item of found) {
      if (item.isIntersecting && item.target.clientWidth > 0) {
        watch.unobserve(item.target);
        draw(item.target);
      }
    }
  }, { rootMargin: "400px" });
  const places = document.querySelectorAll(".chart");
  places.forEach((place) => watch.observe(place));
  dark.addEventListener("change", () => [...shown.keys()].forEach(draw));
  addEventListener("resize", () => {
    clearTimeout(draw.timer);
    draw.timer = setTimeout(() => [...shown.keys()].forEach((place) => {
      if (Math.round(place.clientWidth) !== Number(place.dataset.drawn) && place.clientWidth) draw(place);
    }), 200);
  });
  // a page on paper has all of them
  addEventListener("beforeprint", () => places.forEach((p) => p.clientWidth && !shown.has(p) && draw(p)));
})();
