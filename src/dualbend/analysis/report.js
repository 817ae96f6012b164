// Colours of the plots follow the page's; on a narrow screen legends wrap and a finger scrolls.
(function () {
  "use strict";
  const dark = window.matchMedia("(prefers-color-scheme: dark)");
  const narrow = window.matchMedia("(max-width: 40rem)");
  const coarse = window.matchMedia("(pointer: coarse)");

  function colour(name) {
    return getComputedStyle(document.documentElement).getPropertyValue(name).trim();
  }

  function paint(model) {
    const bg = colour("--bg"), fg = colour("--fg"), soft = colour("--soft"), line = colour("--line");
    if (model.type === "Figure") {
      model.setv({background_fill_color: bg, border_fill_color: bg});
      if (coarse.matches) model.toolbar.active_drag = null;
    } else if (model.type.endsWith("Axis")) {
      model.setv({
        axis_label_text_color: fg, major_label_text_color: soft, axis_line_color: soft,
        major_tick_line_color: soft, minor_tick_line_color: line,
      });
    } else if (model.type === "Grid") {
      model.setv({grid_line_color: line});
    } else if (model.type === "Title") {
      model.setv({text_color: fg});
    } else if (model.type === "Legend") {
      const wide = model.items.length > 4 ? 3 : 2;
      model.setv({label_text_color: fg, ncols: narrow.matches ? wide : model.items.length});
    }
  }

  function repaint() {
    for (const doc of Bokeh.documents) for (const model of doc.all_models) paint(model);
  }

  dark.addEventListener("change", repaint);
  narrow.addEventListener("change", repaint);
  const wait = setInterval(function () {
    if (window.Bokeh && Bokeh.documents.length) {
      clearInterval(wait);
      repaint();
    }
  }, 20);
})();
