// Draws the plots of a report with Bokeh from the data in the page. Colours follow the page's; on a
// narrow screen legends wrap, and a finger scrolls instead of zooming.
(function () {
  "use strict";
  const P = Bokeh.Plotting, BAND = "#808080";
  const dark = window.matchMedia("(prefers-color-scheme: dark)");
  const narrow = window.matchMedia("(max-width: 40rem)");
  const coarse = window.matchMedia("(pointer: coarse)");
  const data = JSON.parse(document.getElementById("plots").textContent);
  const ranges = data.ranges.map(([start, end]) => new Bokeh.Range1d({start, end}));
  const figures = [];

  function unpack(text) {
    const bytes = Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
    return new Float32Array(bytes.buffer);
  }

  function axisText(axis) {
    if (!axis.label) return null;
    return axis.unit && axis.unit !== "1" ? `${axis.label} [${axis.unit}]` : axis.label;
  }

  function frame(spec, more) {
    const options = {
      height: spec.height_px, sizing_mode: "stretch_width", min_width: 200, min_border_right: 12,
      tools: ["pan", "box_zoom", "wheel_zoom", "reset", "save"], toolbar_location: "above", toolbar_sticky: false,
      x_axis_type: spec.x.scale, x_axis_label: axisText(spec.x), y_axis_label: axisText(spec.y),
      match_aspect: spec.true_to_scale, lod_threshold: null, ...more,
    };
    if (spec.title) options.title = spec.title;
    if (spec.x.range !== null) options.x_range = ranges[spec.x.range];
    if (spec.y.range !== null) options.y_range = ranges[spec.y.range];
    const figure = P.figure(options);
    figure.toolbar.logo = null;
    figure.outline_line_color = null;
    return figure;
  }

  function draw(figure, curve) {
    const source = new Bokeh.ColumnDataSource({data: {x: unpack(curve.x), y: unpack(curve.y)}});
    const [x, y] = [{field: "x"}, {field: "y"}];
    if (curve.marker) {
      return figure.scatter(x, y, {source, marker: curve.marker, size: 11, color: curve.colour});
    }
    return figure.line(x, y, {
      source, line_color: curve.colour, line_width: curve.width, line_dash: curve.dash,
      line_alpha: curve.opacity, line_join: "round",
    });
  }

  function tip(axis, field) {
    return [axis.label, `@${field}{%.4g} ${axis.unit === "1" ? "" : axis.unit}`];
  }

  function lines(spec) {
    const figure = frame(spec, {y_axis_type: spec.y.scale});
    for (const [left, right] of spec.bands) {
      figure.add_layout(new Bokeh.BoxAnnotation(
        {left, right, fill_color: BAND, fill_alpha: 0.12, line_color: null}));
    }
    for (const rings of spec.areas) {
      const xs = [[rings.map((ring) => Array.from(unpack(ring[0])))]];
      const ys = [[rings.map((ring) => Array.from(unpack(ring[1])))]];
      figure.multi_polygons(xs, ys, {fill_color: BAND, fill_alpha: 0.2, line_color: null});
    }
    for (const [places, dimension] of [[spec.knots, "height"], [spec.levels, "width"]]) {
      for (const location of places) {
        figure.add_layout(new Bokeh.Span(
          {location, dimension, line_color: BAND, line_alpha: dimension === "width" ? 0.8 : 0.4}));
      }
    }
    const items = [];
    for (const curve of spec.curves) {
      const renderer = draw(figure, curve);
      const name = curve.name || "theory";
      figure.add_tools(new Bokeh.HoverTool({
        renderers: [renderer], tooltips: [["", name], tip(spec.x, "x"), tip(spec.y, "y")],
        formatters: {"@x": "printf", "@y": "printf"}, visible: false,
      }));
      if (curve.name) items.push(new Bokeh.LegendItem({label: curve.name, renderers: [renderer]}));
    }
    if (items.length) {
      figure.add_layout(new Bokeh.Legend({
        items, orientation: "horizontal", click_policy: "hide", border_line_color: null,
        background_fill_alpha: 0, label_text_font_size: "12px", margin: 0, padding: 4, location: "left",
      }), "below");
    }
    return figure;
  }

  function lanes(spec) {
    const names = [...new Set(spec.bars.map((bar) => bar.lane))].reverse();
    const figure = frame(spec, {y_range: names});
    const column = (key) => spec.bars.map((bar) => bar[key]);
    const source = new Bokeh.ColumnDataSource({data: {
      y: column("lane"), left: column("start"), right: column("end"), label: column("label"),
      colour: column("colour"), takes: spec.bars.map((bar) => bar.end - bar.start),
    }});
    const bars = figure.hbar({
      y: {field: "y"}, left: {field: "left"}, right: {field: "right"}, height: 0.7,
      fill_color: {field: "colour"}, line_color: null, source,
    });
    figure.add_tools(new Bokeh.HoverTool({renderers: [bars], visible: false, tooltips: [
      ["phase", "@label"], ["from", "@left{0.00} s"], ["to", "@right{0.00} s"],
      ["takes", "@takes{0.00} s"],
    ]}));
    return figure;
  }

  function paint([figure, place]) {
    const page = getComputedStyle(document.documentElement);
    const [bg, fg, soft, line] = ["--bg", "--fg", "--soft", "--line"].map(
      (name) => page.getPropertyValue(name).trim());
    figure.setv({background_fill_color: bg, border_fill_color: bg});
    if (figure.title) figure.title.text_color = fg;
    for (const axis of figure.axes) {
      axis.setv({
        axis_label_text_color: fg, axis_label_text_font_style: "normal",
        major_label_text_color: soft, axis_line_color: soft, major_tick_line_color: soft,
        minor_tick_line_color: line,
      });
    }
    for (const grid of figure.center.filter((item) => item.type === "Grid")) {
      grid.grid_line_color = line;
    }
    for (const legend of figure.below.filter((item) => item.type === "Legend")) {
      const columns = Math.max(2, Math.floor(place.clientWidth / 130));
      legend.setv({label_text_color: fg, ncols: Math.min(columns, legend.items.length)});
    }
  }

  const repaint = () => figures.forEach(paint);
  dark.addEventListener("change", repaint);
  narrow.addEventListener("change", repaint);

  const doc = new Bokeh.Document(), places = [];
  for (const [name, spec] of Object.entries(data.plots)) {
    const figure = spec.bars.length ? lanes(spec) : lines(spec);
    if (!coarse.matches) {
      figure.toolbar.active_drag = figure.toolbar.tools.find((t) => t.type === "BoxZoomTool");
    } else {
      figure.toolbar.active_drag = null;
    }
    const place = document.getElementById(name);
    paint([figure, place]);
    figures.push([figure, place]);
    doc.add_root(figure);
    places.push(place);
  }
  Bokeh.embed.add_document_standalone(doc, document.body, places).then(() => {
    document.documentElement.dataset.plots = String(figures.length);
  });
})();
