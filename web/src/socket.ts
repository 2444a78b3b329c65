// A WebSocket that comes back: bounded back-off, one state at a time, decoded messages out.

import { Decoder, encode } from "@msgpack/msgpack";
import type { LinkState } from "./messages";
import { type PageMessage, PROTOCOL, type ServerMessage } from "./wire";

const FIRST_WAIT_MS = 300;
const LONGEST_WAIT_MS = 5000;
/** Close codes after which trying again cannot help: protocol, policy. */
const FINAL_CODES = new Set([1002, 1003, 1008]);

export interface SocketEvents {
  message(message: ServerMessage, raw: Uint8Array): void;
  state(state: LinkState, reason: string, retryInMs: number | null): void;
}

export class Socket {
  private readonly decoder = new Decoder();
  private socket: WebSocket | null = null;
  private wait = FIRST_WAIT_MS;

  constructor(
    private readonly url: string,
    private readonly events: SocketEvents,
  ) {
    this.open();
  }

  /** Send a message; dropped when there is nobody to hear it. */
  send(message: PageMessage): void {
    if (this.socket?.readyState === WebSocket.OPEN) this.socket.send(encode(message));
  }

  private open(): void {
    this.events.state("connecting", "", null);
    const socket = new WebSocket(this.url, PROTOCOL);
    socket.binaryType = "arraybuffer";
    this.socket = socket;
    socket.onopen = () => {
      this.wait = FIRST_WAIT_MS;
      this.events.state("open", "", null);
    };
    socket.onmessage = (event: MessageEvent<ArrayBuffer>) => this.receive(new Uint8Array(event.data));
    socket.onclose = (event) => this.closed(event.code, event.reason);
  }

  private receive(raw: Uint8Array): void {
    let message: ServerMessage;
    try {
      message = this.decoder.decode(raw) as ServerMessage;
    } catch {
      this.socket?.close(4000, "a message could not be read");
      return;
    }
    this.events.message(message, raw);
  }

  private closed(code: number, reason: string): void {
    if (FINAL_CODES.has(code)) {
      this.events.state("refused", reason || `the server closed the connection (${code})`, null);
      return;
    }
    const wait = this.wait * (0.8 + 0.4 * Math.random());
    this.wait = Math.min(this.wait * 2, LONGEST_WAIT_MS);
    this.events.state("lost", reason || "the server does not answer", wait);
    setTimeout(() => this.open(), wait);
  }
}
