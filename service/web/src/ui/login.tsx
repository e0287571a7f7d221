/** Asks for the API key, where the service wants one. */

import { useRef, useState } from "preact/hooks";
import { call, setKey } from "../api/client";
import { useTitle } from "./title";

export function Login() {
  useTitle("API key");
  const input = useRef<HTMLInputElement>(null);
  const [refused, setRefused] = useState("");
  const enter = async (event: Event) => {
    event.preventDefault();
    const key = input.current!.value.trim();
    try {
      await call("v1/campaigns?limit=1", { headers: { Authorization: `Bearer ${key}` } });
      setKey(key);
    } catch (error) {
      setRefused((error as Error).message);
    }
  };
  return (
    <form class="card login" onSubmit={enter}>
      <h1>API key</h1>
      <p>This service wants a key. It stays in this tab, and is forgotten with it.</p>
      <label>
        Key <input ref={input} type="password" autocomplete="off" required autofocus />
      </label>
      {refused && <p role="alert">{refused}</p>}
      <button class="primary">Enter</button>
    </form>
  );
}
