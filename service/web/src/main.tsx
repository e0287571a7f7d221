import "uplot/dist/uPlot.min.css";
import "./style.css"; // before the screens, whose own styles refine it
import { render } from "preact";
import { App } from "./app";
import { definePalette } from "./ui/palette";

definePalette();
render(<App />, document.getElementById("page")!);
