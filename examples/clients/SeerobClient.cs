// A client of seerob's server for Unity or any .NET: no package beside this file. Messages: docs/protocol.md.
//
// In Unity: put it in Assets, call Connect once, Presence as often as pictures are drawn (30 a second are sent),
// and read Bodies and Others in Update. Everything public is in Unity's axes (x right, y up, z ahead, left-handed);
// seerob's world is x ahead, y left, z up, right-handed: (x, y, z) there is (-y, z, x) here.
using System;
using System.Collections.Generic;
using System.IO;
using System.Net.WebSockets;
using System.Text;
using System.Threading;
using System.Threading.Tasks;

namespace Seerob
{
    /// <summary>Where a body or a limb is: metres and a unit quaternion, in Unity's axes.</summary>
    public struct Pose
    {
        public float X, Y, Z, Qx, Qy, Qz, Qw;
    }

    /// <summary>Another visitor.</summary>
    public sealed class Visitor
    {
        public long Id;
        public string Name, Role, Color;
        public double Scale;
        public Pose? Head, Left, Right;
    }

    /// <summary>One connection; whatever is read of it is replaced as a whole, so any thread may read.</summary>
    public sealed class Client : IDisposable
    {
        const string Protocol = "seerob.v2.msgpack";
        const int AcknowledgedEvery = 4;
        readonly ClientWebSocket socket = new ClientWebSocket();
        readonly SemaphoreSlim sending = new SemaphoreSlim(1, 1);
        readonly CancellationTokenSource over = new CancellationTokenSource();
        string[] nodes = new string[0];
        int unheard;

        /// <summary>Number of this visitor.</summary>
        public long Number { get; private set; }
        /// <summary>Run time of Bodies [s].</summary>
        public double Time { get; private set; }
        /// <summary>Where each body is, by its full name.</summary>
        public IReadOnlyDictionary<string, Pose> Bodies { get; private set; } = new Dictionary<string, Pose>();
        /// <summary>Verdict of each criterion, or null.</summary>
        public IReadOnlyDictionary<string, string> Verdicts { get; private set; } = new Dictionary<string, string>();
        /// <summary>The other visitors, by number.</summary>
        public IReadOnlyDictionary<long, Visitor> Others { get; private set; } = new Dictionary<long, Visitor>();

        /// <summary>Connect and introduce oneself; then Listen.</summary>
        /// <param name="url">As seerob prints it, with /ws: wss://192.0.2.7:8080/ws?token=…</param>
        public async Task Connect(string url, string name, string device = "vr", double scale = 1.0)
        {
            socket.Options.AddSubProtocol(Protocol);
            await socket.ConnectAsync(new Uri(url), over.Token);
            await Send(new Dictionary<string, object>
            {
                { "type", "introduction" }, { "name", name }, { "device", device }, { "scale", scale },
            });
        }

        /// <summary>Say where one is; null for what is not there.</summary>
        public Task Presence(Pose head, Pose? left, Pose? right)
        {
            var bytes = new byte[3 * 28];
            Put(bytes, 0, head);
            Put(bytes, 28, left);
            Put(bytes, 56, right);
            return Send(new Dictionary<string, object> { { "type", "presence" }, { "poses", bytes } });
        }

        /// <summary>Read until the server or Dispose ends it.</summary>
        public async Task Listen()
        {
            var buffer = new ArraySegment<byte>(new byte[1 << 16]);
            while (socket.State == WebSocketState.Open)
            {
                var message = new MemoryStream();
                WebSocketReceiveResult part;
                do
                {
                    part = await socket.ReceiveAsync(buffer, over.Token);
                    if (part.MessageType == WebSocketMessageType.Close) return;
                    message.Write(buffer.Array, 0, part.Count);
                } while (!part.EndOfMessage);
                await Take((Dictionary<string, object>)MessagePack.Read(message.ToArray()));
            }
        }

        public void Dispose()
        {
            over.Cancel();
            socket.Dispose();
        }

        async Task Take(Dictionary<string, object> message)
        {
            switch ((string)message["type"])
            {
                case "hello":
                    Number = Convert.ToInt64(message["visitor"]);
                    break;
                case "scene":
                    var names = new List<string>();
                    foreach (Dictionary<string, object> node in (List<object>)message["nodes"]) names.Add((string)node["name"]);
                    nodes = names.ToArray();
                    break;
                case "snapshot":
                    Show(message);
                    if (++unheard % AcknowledgedEvery == 0)
                        await Send(new Dictionary<string, object>
                        {
                            { "type", "command" }, { "action", "ack" }, { "value", Convert.ToDouble(message["seq"]) },
                        });
                    break;
                case "visitors":
                    List(message);
                    break;
                case "presences":
                    Place(message);
                    break;
            }
        }

        void Show(Dictionary<string, object> message)
        {
            var poses = (byte[])message["poses"];
            var bodies = new Dictionary<string, Pose>();
            if (poses.Length != 28 * nodes.Length) return; // belongs to another scene
            for (int i = 0; i < nodes.Length; i++) bodies[nodes[i]] = Get(poses, 28 * i).Value;
            var verdicts = new Dictionary<string, string>();
            object results;
            if (message.TryGetValue("results", out results))
                foreach (List<object> result in (List<object>)results) verdicts[(string)result[0]] = result[5] as string;
            Time = Convert.ToDouble(message["t"]);
            Bodies = bodies;
            Verdicts = verdicts;
        }

        void List(Dictionary<string, object> message)
        {
            var others = new Dictionary<long, Visitor>();
            foreach (Dictionary<string, object> said in (List<object>)message["visitors"])
            {
                var id = Convert.ToInt64(said["id"]);
                Visitor before;
                Others.TryGetValue(id, out before);
                if (id != Number)
                    others[id] = new Visitor
                    {
                        Id = id, Name = (string)said["name"], Role = (string)said["role"], Color = (string)said["color"],
                        Scale = Convert.ToDouble(said["scale"]), Head = before?.Head, Left = before?.Left, Right = before?.Right,
                    };
            }
            Others = others;
        }

        void Place(Dictionary<string, object> message)
        {
            foreach (Dictionary<string, object> said in (List<object>)message["visitors"])
            {
                Visitor visitor;
                if (!Others.TryGetValue(Convert.ToInt64(said["id"]), out visitor)) continue;
                var poses = (byte[])said["poses"];
                visitor.Head = Get(poses, 0);
                visitor.Left = Get(poses, 28);
                visitor.Right = Get(poses, 56);
            }
        }

        // x ahead, y left, z up (right-handed) and x right, y up, z ahead (left-handed): v' = (-y, z, x). A reflection
        // turns the sense of rotations, so the vector part of a quaternion is mapped and negated.
        static Pose? Get(byte[] from, int at)
        {
            var f = new float[7];
            Buffer.BlockCopy(from, at, f, 0, 28);
            if (float.IsNaN(f[0])) return null;
            return new Pose { X = -f[1], Y = f[2], Z = f[0], Qw = f[3], Qx = f[5], Qy = -f[6], Qz = -f[4] };
        }

        static void Put(byte[] into, int at, Pose? pose)
        {
            var f = new float[7];
            if (pose == null) for (int i = 0; i < 7; i++) f[i] = float.NaN;
            else
            {
                var p = pose.Value;
                f = new[] { p.Z, -p.X, p.Y, p.Qw, -p.Qz, p.Qx, -p.Qy };
            }
            Buffer.BlockCopy(f, 0, into, at, 28);
        }

        async Task Send(Dictionary<string, object> message)
        {
            var bytes = MessagePack.Write(message);
            await sending.WaitAsync(over.Token); // one at a time: a WebSocket takes no two
            try { await socket.SendAsync(new ArraySegment<byte>(bytes), WebSocketMessageType.Binary, true, over.Token); }
            finally { sending.Release(); }
        }
    }

    /// <summary>As much of MessagePack as seerob speaks.</summary>
    static class MessagePack
    {
        public static object Read(byte[] data)
        {
            int at = 0;
            return Read(data, ref at);
        }

        static object Read(byte[] d, ref int at)
        {
            byte b = d[at++];
            if (b < 0x80) return (long)b;
            if (b < 0x90) return Map(d, ref at, b & 15);
            if (b < 0xa0) return Array(d, ref at, b & 15);
            if (b < 0xc0) return Text(d, ref at, b & 31);
            if (b >= 0xe0) return (long)(sbyte)b;
            switch (b)
            {
                case 0xc0: return null;
                case 0xc2: return false;
                case 0xc3: return true;
                case 0xc4: return Bytes(d, ref at, (int)Number(d, ref at, 1));
                case 0xc5: return Bytes(d, ref at, (int)Number(d, ref at, 2));
                case 0xc6: return Bytes(d, ref at, (int)Number(d, ref at, 4));
                case 0xca: return (double)BitConverter.ToSingle(BitConverter.GetBytes((uint)Number(d, ref at, 4)), 0);
                case 0xcb: return BitConverter.Int64BitsToDouble((long)Number(d, ref at, 8));
                case 0xcc: return (long)Number(d, ref at, 1);
                case 0xcd: return (long)Number(d, ref at, 2);
                case 0xce: return (long)Number(d, ref at, 4);
                case 0xcf: return (long)Number(d, ref at, 8);
                case 0xd0: return (long)(sbyte)Number(d, ref at, 1);
                case 0xd1: return (long)(short)Number(d, ref at, 2);
                case 0xd2: return (long)(int)Number(d, ref at, 4);
                case 0xd3: return (long)Number(d, ref at, 8);
                case 0xd9: return Text(d, ref at, (int)Number(d, ref at, 1));
                case 0xda: return Text(d, ref at, (int)Number(d, ref at, 2));
                case 0xdb: return Text(d, ref at, (int)Number(d, ref at, 4));
                case 0xdc: return Array(d, ref at, (int)Number(d, ref at, 2));
                case 0xdd: return Array(d, ref at, (int)Number(d, ref at, 4));
                case 0xde: return Map(d, ref at, (int)Number(d, ref at, 2));
                case 0xdf: return Map(d, ref at, (int)Number(d, ref at, 4));
                default: throw new InvalidDataException("MessagePack of kind " + b);
            }
        }

        static ulong Number(byte[] d, ref int at, int bytes)
        {
            ulong found = 0;
            for (int i = 0; i < bytes; i++) found = found << 8 | d[at++];
            return found;
        }

        static byte[] Bytes(byte[] d, ref int at, int n)
        {
            var found = new byte[n];
            Buffer.BlockCopy(d, at, found, 0, n);
            at += n;
            return found;
        }

        static string Text(byte[] d, ref int at, int n)
        {
            at += n;
            return Encoding.UTF8.GetString(d, at - n, n);
        }

        static List<object> Array(byte[] d, ref int at, int n)
        {
            var found = new List<object>();
            for (int i = 0; i < n; i++) found.Add(Read(d, ref at));
            return found;
        }

        static Dictionary<string, object> Map(byte[] d, ref int at, int n)
        {
            var found = new Dictionary<string, object>();
            for (int i = 0; i < n; i++)
            {
                var key = Read(d, ref at);
                found[Convert.ToString(key)] = Read(d, ref at);
            }
            return found;
        }

        public static byte[] Write(Dictionary<string, object> map)
        {
            var into = new MemoryStream();
            into.WriteByte((byte)(0x80 | map.Count));
            foreach (var pair in map)
            {
                Value(into, pair.Key);
                Value(into, pair.Value);
            }
            return into.ToArray();
        }

        static void Value(MemoryStream into, object value)
        {
            if (value is string)
            {
                var text = Encoding.UTF8.GetBytes((string)value);
                Head(into, 0xda, text.Length);
                into.Write(text, 0, text.Length);
            }
            else if (value is byte[])
            {
                var bytes = (byte[])value;
                Head(into, 0xc5, bytes.Length);
                into.Write(bytes, 0, bytes.Length);
            }
            else
            {
                var bits = BitConverter.GetBytes(BitConverter.DoubleToInt64Bits(Convert.ToDouble(value)));
                System.Array.Reverse(bits);
                into.WriteByte(0xcb);
                into.Write(bits, 0, 8);
            }
        }

        static void Head(MemoryStream into, byte kind, int length)
        {
            into.WriteByte(kind);
            into.WriteByte((byte)(length >> 8));
            into.WriteByte((byte)length);
        }
    }
}
