"use strict";
(function () {
  const PRINT_WIDTH = 680; // px of an A4 page between its margins
  const PRINT_HEIGHT = 0.75; // of the height on the screen, so that two pictures share a page
  const config = { responsive: true, displaylogo: false, displayModeBar: true, modeBarButtonsToRemove: ["select2d", "lasso2d"] };
  const plots = Array.from(document.querySelectorAll(".plot"));
  function draw(div) {
    if (div.dataset.drawn) return;
    div.dataset.drawn = "yes";
    const spec = JSON.parse(document.getElementById(div.dataset.spec).textContent);
    Plotly.newPlot(div, spec.data, spec.layout, config);
  }
  // A picture is drawn when it comes near the window or its fold is opened: the page opens at once.
  const seen = new IntersectionObserver((entries) => {
    for (const entry of entries) if (entry.isIntersecting) draw(entry.target);
  }, { rootMargin: "600px" });
  plots.forEach((div) => seen.observe(div));
  const visible = (div) => div.offsetParent !== null;
  window.addEventListener("beforeprint", () => {
    plots.filter(visible).forEach((div) => {
      draw(div);
      div.dataset.height = div.style.height;
      div.style.height = PRINT_HEIGHT * parseFloat(div.style.height) + "px";
      Plotly.relayout(div, { width: PRINT_WIDTH, height: parseFloat(div.style.height) });
    });
  });
  window.addEventListener("afterprint", () => {
    plots.filter((div) => div.dataset.height).forEach((div) => {
      div.style.height = div.dataset.height;
      Plotly.relayout(div, { width: null, height: null, autosize: true });
    });
  });
})();
