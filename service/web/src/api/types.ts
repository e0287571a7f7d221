/** The bodies of the API by their names in `openapi.yaml`, where each field is declared and described. */

import type { components } from "./schema";

type Schemas = components["schemas"];
export type Body<Name extends keyof Schemas> = Schemas[Name];
