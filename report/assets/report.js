"use strict";
(() => {
  const root = document.documentElement;
  const saveButton = (format, icon, filename) => ({
    name: `save-${format}`, title: `Save as ${format.toUpperCase()}`, icon,
    click: (graph) => Plotly.downloadImage(graph, { format, filename, scale: 2, width: graph._fullLayout.width, height: graph._fullLayout.height }),
  });
  // Made once per plot: Plotly compares configurations by identity of their functions and starts over where they
  // differ, and two draws that differ in them would set each other off without end.
  const configOf = (name) => ({
    displaylogo: false, responsive: false, displayModeBar: "hover",
    modeBarButtons: [["resetScale2d", saveButton("png", Plotly.Icons.camera, name), saveButton("svg", Plotly.Icons.disk, name)]],
  });
  const plots = [...document.querySelectorAll(".plot")].map((element) => ({
    element,
    spec: JSON.parse(element.parentNode.querySelector("script").textContent),
    config: configOf(element.closest("figure").id),
  }));
  const FULL_PAGE_PX = 680; // A4 less its margins, at 96 px to the inch
  const touch = window.matchMedia("(hover: none)").matches; // a finger on a figure scrolls the page
  let printing = false;

  // "@ink" and "@paper/0.8" are colours of the page's theme, "#0072B2/0.16" any colour with an opacity.
  const LIGHT = { ink: "#1d2126", paper: "#ffffff", muted: "#667079", grid: "#e9ecef", line: "#c3c9cf" };
  const DARK = { ink: "#e4e7ea", paper: "#14171b", muted: "#98a2ab", grid: "#262c32", line: "#4a525a" };
  const systemDark = window.matchMedia("(prefers-color-scheme: dark)");
  const isDark = () => !printing && (root.dataset.theme ? root.dataset.theme === "dark" : systemDark.matches);
  const colour = (code) => {
    const [name, opacity] = code.split("/");
    const hex = name[0] === "@" ? (isDark() ? DARK : LIGHT)[name.slice(1)] : name;
    if (opacity === undefined) return hex;
    const part = (at) => parseInt(hex.slice(at, at + 2), 16);
    return `rgba(${part(1)},${part(3)},${part(5)},${opacity})`;
  };
  const COLOUR_KEYS = new Set(["color", "fillcolor", "bgcolor"]);
  const themed = (value, key) => {
    if (Array.isArray(value)) return value.length && typeof value[0] === "object" && value[0] ? value.map((item) => themed(item)) : value;
    if (value && typeof value === "object") {
      return Object.fromEntries(Object.entries(value).map(([inner, item]) => [inner, themed(item, inner)]));
    }
    return typeof value === "string" && COLOUR_KEYS.has(key) ? colour(value) : value;
  };

  const layoutOf = (spec, width) => {
    const narrow = width < 520;
    const layout = themed(spec.layout);
    const ink = colour("@ink"), grid = colour("@grid"), line = colour("@line"), paper = colour("@paper");
    for (const key of Object.keys(layout).filter((name) => /^[xy]axis/.test(name))) {
      Object.assign(layout[key], {
        gridcolor: grid, zerolinecolor: line, linecolor: line, tickcolor: line,
        showline: true, ticks: "outside", ticklen: 4, automargin: true, nticks: narrow ? 5 : 9,
      });
    }
    if (layout.yaxis2) {
      for (const key of Object.keys(layout).filter((name) => /^yaxis/.test(name))) layout[key].nticks = 4;
    }
    for (const note of layout.annotations) note.font = { color: ink, size: narrow ? 11 : 13 };
    const margin = { l: narrow ? 48 : 60, r: narrow ? 8 : 16, t: 8, b: 44 };
    if (printing) layout.height *= 0.75; // two rows of small figures to a page
    if (spec.aspect) {
      const drawn = (width - margin.l - margin.r) * spec.aspect;
      const legend = spec.data.some((trace) => trace.showlegend !== false) ? 56 : 0;
      layout.height = Math.min(Math.max(drawn, 200), 640) + margin.t + margin.b + legend;
    }
    return Object.assign(layout, {
      width, margin, paper_bgcolor: paper, plot_bgcolor: paper, barmode: "group",
      font: { family: getComputedStyle(document.body).fontFamily, size: narrow ? 11 : 12.5, color: ink },
      hoverlabel: { bgcolor: paper, bordercolor: line, font: { color: ink } },
      hovermode: "closest", dragmode: touch ? false : "zoom", uirevision: "kept",
      showlegend: spec.data.filter((trace) => trace.showlegend !== false).length > 1,
      legend: {
        orientation: "h", x: 0, xanchor: "left", y: 1.02, yanchor: "bottom",
        groupclick: "togglegroup", tracegroupgap: 4, itemwidth: 30,
      },
      modebar: { bgcolor: "rgba(0,0,0,0)", color: colour("@muted"), activecolor: ink },
    });
  };

  const draw = (plot) => {
    const { element, spec } = plot;
    const panels = element.closest(".panels").children.length;
    const width = printing ? (panels > 1 ? FULL_PAGE_PX / 2 - 12 : FULL_PAGE_PX) : element.clientWidth;
    plot.width = width;
    return Plotly.react(element, spec.data.map((trace) => themed(trace)), layoutOf(spec, width), plot.config);
  };
  const drawAll = () => plots.forEach(draw);

  // One after another, so that the text can be read and scrolled meanwhile.
  const drawNext = (index) => {
    if (index >= plots.length) return;
    draw(plots[index]);
    setTimeout(() => drawNext(index + 1), 0);
  };
  drawNext(0);

  let pending = 0;
  const resized = new ResizeObserver(() => {
    clearTimeout(pending);
    pending = setTimeout(() => {
      if (!printing) plots.filter((plot) => plot.width && plot.width !== plot.element.clientWidth).forEach(draw);
    }, 100);
  });
  plots.forEach((plot) => resized.observe(plot.element));
  window.addEventListener("beforeprint", () => { printing = true; drawAll(); });
  window.addEventListener("afterprint", () => { printing = false; drawAll(); });
  systemDark.addEventListener("change", drawAll);

  const button = document.getElementById("theme");
  const names = { "": "Auto", light: "Light", dark: "Dark" };
  const setTheme = (theme) => {
    if (theme) root.dataset.theme = theme; else delete root.dataset.theme;
    button.textContent = names[theme];
  };
  button.addEventListener("click", () => {
    const order = ["", "light", "dark"];
    setTheme(order[(order.indexOf(root.dataset.theme || "") + 1) % order.length]);
    drawAll();
  });
  setTheme("");
  button.hidden = false;
})();
