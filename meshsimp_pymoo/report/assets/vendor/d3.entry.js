export { scaleLinear, scaleLog } from "d3-scale";
export { format } from "d3-format";
